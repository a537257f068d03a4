"""The trackers by name: `load_tracker`, and the folders of their weights."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args

from numpy.typing import ArrayLike

from ssiam.errors import ArgumentError, WeightsError, check_choice
from ssiam.motion import MaskOf
from ssiam.runtime import (
    MODEL_ZOO,
    DeviceName,
    Precision,
    PublishedWeights,
    RuntimeName,
    RuntimeOptions,
)
from ssiam.runtime.model_zoo import OTHER_WEIGHTS, how_to_get_weights
from ssiam.stabilize import Method, StabilizerConfig
from ssiam.trackers import siammask, siamrpn
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.dlib_correlation import DlibName, DlibTracker
from ssiam.trackers.fear import FearName, FearNetworks, FearXs
from ssiam.trackers.lite import SHIPPED, LiteName, LiteNetworks, LiteTracker
from ssiam.trackers.named_classes import entry_point_names, is_class_path, load_named
from ssiam.trackers.nanotrack import (
    CONFIDENCE,
    PARAMETERS,
    PREFERRING,
    NanoTrack,
    NanoTrackName,
    NanoTrackNetworks,
)
from ssiam.trackers.one_stream import (
    OneStreamName,
    OneStreamNetwork,
    OneStreamTracker,
    description_file,
)
from ssiam.trackers.opencv import OpenCvName, OpenCvTracker
from ssiam.trackers.opencv_networks import OpenCvNetworkName, OpenCvNetworkTracker
from ssiam.trackers.siamfc import SiamFc, SiamFcName, SiamFcNetworks
from ssiam.trackers.siammask import SiamMask, SiamMaskName, SiamMaskNetworks, SiamMaskParameters
from ssiam.trackers.siamrpn import SiamRpn, SiamRpnName, SiamRpnNetworks, SiamRpnParameters
from ssiam.trackers.stabilized import StabilizedTracker
from ssiam.trackers.template_memory import TemplateMemoryTracker

SiameseName: TypeAlias = Literal[SiamFcName, SiamRpnName, SiamMaskName]
TrackerName: TypeAlias = Literal[
    LiteName,
    OpenCvName,
    NanoTrackName,
    FearName,
    OneStreamName,
    OpenCvNetworkName,
    DlibName,
    SiameseName,
]
TRACKERS: tuple[TrackerName, ...] = get_args(TrackerName)
DEFAULT_TRACKER: TrackerName = "lite"

_CLASS_FORM: Final = "package.module:Class"

_ANCHOR_PARAMETERS: Final[dict[str, SiamRpnParameters]] = {
    name: parameters
    for name, parameters in (*siamrpn.PARAMETERS.items(), *siammask.PARAMETERS.items())
}


def load_tracker(
    name: TrackerName | str | None = None,
    *,
    weights: str | os.PathLike[str] | None = None,
    stabilize: Method | StabilizerConfig = "predict",
    runtime: RuntimeName = "openvino",
    threads: int = 1,
    precision: Precision = "f32",
    device: DeviceName | None = None,
    template_memory: bool = False,
    distractors: bool | None = None,
    static_mask: ArrayLike | MaskOf | None = None,
) -> StabilizedTracker:
    """Load a tracker that runs on stabilized frames.

    Parameters
    ----------
    name : str, optional
        One of `TRACKERS`; or ``package.module:Class``, or an entry point of the group
        ``ssiam.trackers``, which runs code of that package. The default tracker needs no weights.
    weights : path, optional
        File or folder of the networks, for trackers that have any: the authors' .pth file, or
        .onnx files. By default those in this package (lite), or those that
        `ssiam weights import` has stored. A class of another package gets it as `weights`, and
        `threads`, if its signature has these parameters.
    stabilize : {"predict", "paper", "literal", "off"} or StabilizerConfig
        "off" runs the tracker alone.
    runtime : {"openvino", "onnxruntime", "torch"}
        Inference engine of the networks. With the first two a .pth file is exported to ONNX once,
        into the user's cache folder.
    threads : int
        CPU threads of one inference.
    precision : {"f32", "bf16", "f16", "int8"}
        Arithmetic of the networks. "bf16": openvino and torch; "f16": torch on a GPU; "int8":
        openvino and onnxruntime, with files that were exported in int8.
    device : {"cpu", "cuda", "tensorrt", "coreml", "mps"}, optional
        The CPU by default, and always for openvino. onnxruntime also has "cuda", "tensorrt" and
        "coreml"; torch has "cuda" and "mps".
    template_memory : bool
        Whether the tracker takes further templates of its target, after THOR
        (`ssiam.trackers.template_memory`). Not for csrt and mil.
    distractors : bool, optional
        Whether the tracker recognizes objects like its target by their positions
        (`ssiam.trackers.distractors`); by default only lite. Not for csrt, kcf and mil.
    static_mask : (H, W) bool or uint8, or callable, optional
        Set (not 0) where the frames show what moves with the camera, such as your vehicle or a
        display; see `CameraMotion`.

    Returns
    -------
    StabilizedTracker
        A tracker without a target: call its `init` first.

    Raises
    ------
    ValueError
        The tracker, stabilization or runtime is unknown, the runtime does not support the
        precision or device, or the tracker does not support the memory or distractors.
    WeightsError
        The weights are missing, damaged or of another network.
    MissingExtraError
        The runtime, or a package that reads the weights, is not installed.

    Examples
    --------
    >>> tracker = ssiam.load_tracker("nanotrack_v3", weights="weights/nanotrackv3")
    >>> tracker.init(frame, (291, 124, 80, 60))
    >>> tracker.update(next_frame).box
    """
    name = check_tracker_name(name or DEFAULT_TRACKER)
    options = RuntimeOptions(runtime, threads, precision, device)
    config = StabilizerConfig(stabilize) if isinstance(stabilize, str) else stabilize
    path = None if weights is None else Path(weights)
    if distractors is None:
        distractors = recognizes_distractors(name)
    if is_named_class(name):
        tracker = _named_tracker(name, path, options, distractors)
    else:
        known = check_choice("tracker", name, TRACKERS)
        tracker = _view_tracker(known, path, options, distractors)
    if template_memory and not tracker.can_seek:
        raise ArgumentError(f"tracker {name} cannot search around a given box: it has no memory")
    if template_memory:
        tracker = TemplateMemoryTracker(tracker)
    return StabilizedTracker(tracker, config, static_mask)


def check_tracker_name(name: str) -> str:
    """The name, if `load_tracker` knows it; nothing is imported.

    Only for names from the command line or from code: a tracker of another package runs code.

    Raises
    ------
    ArgumentError
        It is neither one of `TRACKERS`, nor has the form ``package.module:Class``, nor is the name
        of an entry point.
    """
    if name in TRACKERS or is_class_path(name):
        return name
    return check_choice("tracker", name, (*TRACKERS, *entry_point_names(), _CLASS_FORM))


def is_named_class(name: str) -> bool:
    """Whether a checked name is that of another package's class."""
    return name not in TRACKERS


def _named_tracker(
    name: str, weights: Path | None, options: RuntimeOptions, distractors: bool
) -> CompleteTracker:
    if options.precision != "f32" or options.resolved_device != "cpu":
        raise ArgumentError(
            f"tracker {name} runs its network by itself: leave precision and device out"
        )
    if distractors:
        raise ArgumentError(f"tracker {name} has no known score map: leave distractors out")
    return load_named(name, weights, options.threads)


def _view_tracker(
    name: TrackerName, weights: Path | None, options: RuntimeOptions, distractors: bool
) -> CompleteTracker:
    if name == "csrt" or name == "kcf" or name == "mil" or name == "dlib":
        if weights is not None:
            raise WeightsError(f"tracker {name} has no weights: leave {weights} out")
        if options.precision != "f32" or options.resolved_device != "cpu":
            raise ArgumentError(f"tracker {name} has no network: leave precision and device out")
        if distractors:
            raise ArgumentError(f"tracker {name} has no score map: leave distractors out")
        return DlibTracker() if name == "dlib" else OpenCvTracker(name)
    if name == "lite":
        lite = LiteNetworks.load(weights or SHIPPED, options)
        return LiteTracker(lite, distractors=distractors)
    if name == "one_stream":
        if weights is None:
            raise WeightsError(
                "tracker one_stream needs weights: give the .toml file that describes a network "
                "(--weights PATH, weights=PATH; docs/how-to/weights.md)"
            )
        if distractors:
            raise ArgumentError("tracker one_stream has no known score map: leave distractors out")
        return OneStreamTracker(OneStreamNetwork.load(weights, options))
    if name == "opencv_vit" or name == "opencv_nano" or name == "opencv_dasiamrpn":
        return _opencv_network_tracker(name, weights, options, distractors)
    path = _required_weights(name, weights)
    if name == "nanotrack_v1" or name == "nanotrack_v2" or name == "nanotrack_v3":
        networks = NanoTrackNetworks.load(name, path, options)
        return NanoTrack(
            networks,
            PARAMETERS[name],
            CONFIDENCE[name],
            distractors=distractors,
            prefers_prediction=name in PREFERRING,
        )
    if name == "fear_xs":
        return FearXs(FearNetworks.load(path, options), distractors=distractors)
    return load_siamese_tracker(name, path, options, distractors=distractors)


def _opencv_network_tracker(
    name: OpenCvNetworkName, weights: Path | None, options: RuntimeOptions, distractors: bool
) -> OpenCvNetworkTracker:
    if options.precision != "f32" or options.resolved_device != "cpu":
        raise ArgumentError(f"tracker {name} runs on OpenCV: leave precision and device out")
    if distractors:
        raise ArgumentError(f"tracker {name} has no known score map: leave distractors out")
    path = weights_path(name) if weights is None else weights
    if path is None:
        brings = "ssiam weights get vittrack, or " if name == "opencv_vit" else ""
        raise WeightsError(
            f"tracker {name} needs weights: {brings}give the folder of its .onnx files (--weights "
            "PATH, weights=PATH; docs/how-to/weights.md)"
        )
    return OpenCvNetworkTracker(name, path)


def load_siamese_tracker(
    name: SiameseName, weights: Path, options: RuntimeOptions, *, distractors: bool = False
) -> SiamFc | SiamRpn | SiamMask:
    """Load one of the paper's trackers, without stabilization.

    Parameters
    ----------
    name : str
        Name of a SiamFC, SiamRPN++ or SiamMask tracker.
    weights : Path
        The authors' .pth file, or a folder of exported .onnx files. See
        `ssiam.runtime.loading.load_pieces`, also for the errors.
    options : RuntimeOptions
    distractors : bool
        Whether the tracker recognizes objects like its target by their positions.
    """
    from ssiam.runtime.loading import load_pieces

    pieces = load_pieces(weights, MODEL_ZOO[name].network, options)
    template, search = pieces["template"], pieces["search"]
    if name == "siamfc":
        return SiamFc(SiamFcNetworks(template, search), distractors=distractors)
    parameters = _ANCHOR_PARAMETERS[name]
    if isinstance(parameters, SiamMaskParameters):
        masks = SiamMaskNetworks(template, search, pieces["refine"])
        return SiamMask(masks, parameters, distractors=distractors)
    return SiamRpn(SiamRpnNetworks(template, search), parameters, distractors=distractors)


def _required_weights(name: str, weights: Path | None) -> Path:
    """`weights`, or those that were imported for the tracker; `WeightsError` if there are none."""
    if weights is not None:
        return weights
    imported = imported_weights(MODEL_ZOO[name])
    if imported is None:
        command = how_to_get_weights(name)
        raise WeightsError(
            f"tracker {name} needs weights: {command}; "
            "or give their path (--weights PATH, weights=PATH)"
        )
    return imported


def recognizes_distractors(name: str) -> bool:
    """Whether a tracker recognizes distractors by default."""
    return name == "lite"


def has_networks(name: str) -> bool:
    """Whether this package runs networks for a tracker; not for OpenCV's, dlib's and others'."""
    others = *get_args(OpenCvName), *get_args(OpenCvNetworkName), *get_args(DlibName)
    return name not in others and not is_named_class(name)


def weights_path(name: str, weights: Path | None = None) -> Path | None:
    """The file or folder of weights that `load_tracker` reads; None without any, or if missing."""
    if name in (*get_args(OpenCvName), *get_args(DlibName)):
        return None
    if weights is None and name == "lite":
        weights = SHIPPED
    elif weights is None and name in MODEL_ZOO:
        weights = imported_weights(MODEL_ZOO[name])
    elif weights is None and name == "opencv_vit":
        weights = imported_weights(OTHER_WEIGHTS["vittrack"])
    if weights is None or not weights.exists():
        return None
    return description_file(weights) if name == "one_stream" else weights


def imported_weights(published: PublishedWeights) -> Path | None:
    """The folder of imported weights, in one of `weights_folders`; None if there is none.

    A folder may also have the name that it has in the authors' repository.
    """
    return find_weights(published, weights_folders())


def find_weights(published: PublishedWeights, folders: Iterable[Path]) -> Path | None:
    """The first folder of published weights in `folders` that is not empty; None without any."""
    names = (published.folder, *published.authors_folders)
    found = (folder / name for folder in folders for name in names)
    return next((path for path in found if path.is_dir() and any(path.iterdir())), None)


def weights_folders() -> tuple[Path, ...]:
    """Folders that are searched for weights: in the user's cache, then ``weights`` here."""
    from ssiam.runtime.files import cache_folder

    return cache_folder() / "weights", Path("weights")
