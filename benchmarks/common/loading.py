"""Loading of any tracker in the benchmarks by name, with the weights of the test data."""

from __future__ import annotations

from pathlib import Path

import ssiam
from benchmarks.common.data import WEIGHTS, nanotrack_weights
from ssiam.errors import check_choice
from ssiam.stabilize import METHODS, Method, StabilizerConfig
from ssiam.trackers import TRACKERS, StabilizedTracker


def load(
    name: str,
    stabilize: str | StabilizerConfig = "predict",
    threads: int = 1,
    *,
    template_memory: bool = False,
    distractors: bool | None = None,
) -> StabilizedTracker:
    """Load a tracker.

    Parameters
    ----------
    name : str
        Of `ssiam.load_tracker`, optionally with a folder of weights: "lite=runs/mine". The weights
        of NanoTrack and FEAR-XS are in the folder of test data.
    stabilize : str or StabilizerConfig
    threads : int
    template_memory : bool
    distractors : bool, optional
        As for `ssiam.load_tracker`.
    """
    name, _, path = name.partition("=")
    config: Method | StabilizerConfig = (
        check_choice("stabilize", stabilize, METHODS) if isinstance(stabilize, str) else stabilize
    )
    weights = Path(path) if path else None
    if not path and name.startswith("nanotrack"):
        weights = nanotrack_weights(name)
    elif not path and name == "fear_xs":
        weights = WEIGHTS / name
    return ssiam.load_tracker(
        check_choice("tracker", name, TRACKERS),
        weights=weights,
        stabilize=config,
        threads=threads,
        template_memory=template_memory,
        distractors=distractors,
    )
