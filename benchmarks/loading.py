"""Any tracker of the benchmarks by its name: ours, and peers that are not part of the package."""

from __future__ import annotations

from pathlib import Path

import fear_xs
import ssiam
from shared_data import WEIGHTS
from ssiam.stabilize import Method, StabilizerConfig
from ssiam.trackers import StabilizedTracker

PEERS = (fear_xs.NAME,)


def load(
    name: str, stabilize: Method | StabilizerConfig = "predict", threads: int = 1
) -> StabilizedTracker:
    """A tracker.

    Parameters
    ----------
    name : str
        Of `ssiam.load_tracker` or of a peer, or with weights of one's own: "lite=runs/mine". Those
        of NanoTrack and of peers come from the folder of test data.
    stabilize : str or StabilizerConfig
    threads : int
    """
    name, _, path = name.partition("=")
    if name == fear_xs.NAME:
        return fear_xs.load(stabilize, threads)
    weights = Path(path) if path else None
    if not path and name.startswith("nanotrack"):
        weights = WEIGHTS / name.replace("_", "")
    return ssiam.load_tracker(name, weights=weights, stabilize=stabilize, threads=threads)
