"""The trackers by name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from ssiam.errors import ArgumentError, WeightsError, check_choice
from ssiam.runtime import RuntimeName
from ssiam.stabilize import Method, StabilizerConfig
from ssiam.trackers.base import ViewTracker
from ssiam.trackers.nanotrack import PARAMETERS, NanoTrack, NanoTrackName, NanoTrackNetworks
from ssiam.trackers.opencv import OpenCvName, OpenCvTracker
from ssiam.trackers.steadied import SteadiedTracker

TrackerName: TypeAlias = Literal[OpenCvName, NanoTrackName]
TRACKERS: tuple[TrackerName, ...] = get_args(TrackerName)
DEFAULT_TRACKER: TrackerName = "csrt"


def load_tracker(
    name: TrackerName | None = None,
    *,
    weights: str | os.PathLike[str] | None = None,
    stabilize: Method | StabilizerConfig = "paper",
    runtime: RuntimeName = "openvino",
    threads: int = 1,
) -> SteadiedTracker:
    """A tracker by its name, steadied.

    Parameters
    ----------
    name : str, optional
        One of `TRACKERS`; None is the default tracker, which needs no weights.
    weights : path, optional
        File or folder of the networks, for trackers that have any.
    stabilize : {"off", "paper", "literal"} or StabilizerConfig
        "off" is the tracker alone.
    runtime : {"openvino"}
        What runs the networks.
    threads : int
        CPU threads of one inference.

    Raises
    ------
    ValueError
        Unknown tracker, stabilisation or runtime.
    WeightsError
        Weights that are missing, damaged or of another network.

    Examples
    --------
    >>> tracker = ssiam.load_tracker("nanotrack_v3", weights="weights/nanotrackv3")
    >>> tracker.init(frame, (291, 124, 80, 60))
    >>> tracker.update(next_frame).box
    """
    name = name or DEFAULT_TRACKER
    check_choice("tracker", name, TRACKERS)
    if threads < 1:
        raise ArgumentError(f"threads is {threads}: it must be at least 1")
    config = StabilizerConfig(stabilize) if isinstance(stabilize, str) else stabilize
    path = None if weights is None else Path(weights)
    return SteadiedTracker(_view_tracker(name, path, runtime, threads), config)


def _view_tracker(
    name: TrackerName, weights: Path | None, runtime: RuntimeName, threads: int
) -> ViewTracker:
    if name == "csrt" or name == "kcf" or name == "mil":
        if weights is not None:
            raise WeightsError(f"tracker {name} has no weights: leave {weights} out")
        return OpenCvTracker(name)
    if weights is None:
        raise WeightsError(
            f"tracker {name} needs weights: give the folder of its two .onnx files "
            "(published at github.com/HonglinChu/SiamTrackers)"
        )
    networks = NanoTrackNetworks.load(name, weights, runtime=runtime, threads=threads)
    return NanoTrack(networks, PARAMETERS[name])
