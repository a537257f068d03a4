"""The trackers by name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from ssiam.errors import ArgumentError, WeightsError, check_choice
from ssiam.runtime import DeviceName, Precision, RuntimeName, RuntimeOptions
from ssiam.stabilize import Method, StabilizerConfig
from ssiam.trackers.base import ViewTracker
from ssiam.trackers.lite import SHIPPED, LiteName, LiteNetworks, LiteTracker
from ssiam.trackers.loading import SiameseName, needed_weights, siamese_tracker
from ssiam.trackers.nanotrack import CONFIDENCE, PARAMETERS, NanoTrack
from ssiam.trackers.nanotrack_networks import NanoTrackName, NanoTrackNetworks
from ssiam.trackers.opencv import OpenCvName, OpenCvTracker
from ssiam.trackers.steadied import SteadiedTracker

TrackerName: TypeAlias = Literal[LiteName, OpenCvName, NanoTrackName, SiameseName]
TRACKERS: tuple[TrackerName, ...] = get_args(TrackerName)
DEFAULT_TRACKER: TrackerName = "lite"


def load_tracker(
    name: TrackerName | None = None,
    *,
    weights: str | os.PathLike[str] | None = None,
    stabilize: Method | StabilizerConfig = "predict",
    runtime: RuntimeName = "openvino",
    threads: int = 1,
    precision: Precision = "f32",
    device: DeviceName | None = None,
) -> SteadiedTracker:
    """A tracker by its name, steadied.

    Parameters
    ----------
    name : str, optional
        One of `TRACKERS`; None is the default tracker, which needs no weights.
    weights : path, optional
        File or folder of the networks, for trackers that have any: the authors' .pth file, or
        .onnx files. None takes those that came with the package (lite), or that
        `ssiam weights import` has stored.
    stabilize : {"predict", "paper", "literal", "off"} or StabilizerConfig
        "off" is the tracker alone.
    runtime : {"openvino", "onnxruntime", "torch"}
        What runs the networks. With the first two a .pth file is exported to ONNX once, into the
        user's cache folder.
    threads : int
        CPU threads of one inference.
    precision : {"f32", "bf16", "f16", "int8"}
        Of the networks' arithmetic. bf16: openvino, torch; f16: torch on a graphics card; int8:
        openvino, onnxruntime, with files exported so.
    device : {"cpu", "cuda", "tensorrt", "coreml", "mps"}, optional
        None is the CPU, the only one of openvino; onnxruntime has cuda, tensorrt and coreml,
        torch cuda and mps.

    Raises
    ------
    ValueError
        Unknown tracker, stabilisation or runtime, or a runtime without that precision or device.
    WeightsError
        Weights that are missing, damaged or of another network.
    MissingExtraError
        The runtime, or what reads the weights, is not installed.

    Examples
    --------
    >>> tracker = ssiam.load_tracker("nanotrack_v3", weights="weights/nanotrackv3")
    >>> tracker.init(frame, (291, 124, 80, 60))
    >>> tracker.update(next_frame).box
    """
    name = name or DEFAULT_TRACKER
    check_choice("tracker", name, TRACKERS)
    running = RuntimeOptions(runtime, threads, precision, device)
    config = StabilizerConfig(stabilize) if isinstance(stabilize, str) else stabilize
    path = None if weights is None else Path(weights)
    return SteadiedTracker(_view_tracker(name, path, running), config)


def _view_tracker(name: TrackerName, weights: Path | None, running: RuntimeOptions) -> ViewTracker:
    if name == "csrt" or name == "kcf" or name == "mil":
        if weights is not None:
            raise WeightsError(f"tracker {name} has no weights: leave {weights} out")
        if running.precision != "f32" or running.resolved_device != "cpu":
            raise ArgumentError(f"tracker {name} has no network: leave precision and device out")
        return OpenCvTracker(name)
    if name == "lite":
        return LiteTracker(LiteNetworks.load(weights or SHIPPED, running))
    found = needed_weights(name, weights)
    if name == "nanotrack_v1" or name == "nanotrack_v2" or name == "nanotrack_v3":
        networks = NanoTrackNetworks.load(name, found, running)
        return NanoTrack(networks, PARAMETERS[name], CONFIDENCE[name])
    return siamese_tracker(name, found, running)
