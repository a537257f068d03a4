"""Loading of any tracker in the benchmarks by name: those of the package, and peers."""

from __future__ import annotations

from pathlib import Path

import ssiam
from benchmarks.common import fear_xs
from benchmarks.common.data import nanotrack_weights
from ssiam.errors import check_choice
from ssiam.stabilize import METHODS, Method, StabilizerConfig
from ssiam.trackers import TRACKERS, StabilizedTracker

PEERS = (fear_xs.NAME,)


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
        Of `ssiam.load_tracker` or of a peer, optionally with a folder of weights:
        "lite=runs/mine". The weights of NanoTrack and of peers are in the folder of test data.
    stabilize : str or StabilizerConfig
    threads : int
    template_memory : bool
    distractors : bool, optional
        As for `ssiam.load_tracker`; not for peers.
    """
    name, _, path = name.partition("=")
    config: Method | StabilizerConfig = (
        check_choice("stabilize", stabilize, METHODS) if isinstance(stabilize, str) else stabilize
    )
    if name == fear_xs.NAME:
        return fear_xs.load(config, threads)
    weights = Path(path) if path else None
    if not path and name.startswith("nanotrack"):
        weights = nanotrack_weights(name)
    return ssiam.load_tracker(
        check_choice("tracker", name, TRACKERS),
        weights=weights,
        stabilize=config,
        threads=threads,
        template_memory=template_memory,
        distractors=distractors,
    )
