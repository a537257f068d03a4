"""OpenCV's trackers with networks: VitTrack, NanoTrack and DaSiamRPN in OpenCV's own classes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import cv2

from ssiam.errors import (
    ArgumentError,
    CopyError,
    MissingExtraError,
    TrackingError,
    WeightsError,
    one_line,
)
from ssiam.geometry import XYWH
from ssiam.runtime.files import damaged_error
from ssiam.runtime.onnx_files import check_onnx
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.opencv import pixel_box

OpenCvNetworkName: TypeAlias = Literal["opencv_vit", "opencv_nano", "opencv_dasiamrpn"]

# By tracker: OpenCV's class, and for each field of its parameters a pattern of the file's name.
_CLASSES: Final[dict[OpenCvNetworkName, tuple[str, dict[str, str]]]] = {
    "opencv_vit": ("TrackerVit", {"net": "*vit*.onnx"}),
    "opencv_nano": ("TrackerNano", {"backbone": "*backbone*.onnx", "neckhead": "*head*.onnx"}),
    "opencv_dasiamrpn": (
        "TrackerDaSiamRPN",
        {
            "model": "*model*.onnx",
            "kernel_cls1": "*kernel_cls1*.onnx",
            "kernel_r1": "*kernel_r1*.onnx",
        },
    ),
}
_MIN_SIDE: Final = 2  # px, of a first box: OpenCV divides by the sides


class OpenCvNetworkTracker(CompleteTracker):
    """One of OpenCV's trackers with networks, on the rendered view.

    The score is the tracker's own; it is not calibrated. The tracker cannot search around a given
    box, and cannot be copied while it has a target.

    Threads: one thread at a time for each object.

    Parameters
    ----------
    name : {"opencv_vit", "opencv_nano", "opencv_dasiamrpn"}
    weights : Path
        The network's .onnx file, or the folder of all of them.

    Raises
    ------
    WeightsError
        A file is missing, damaged, or not of this tracker.
    MissingExtraError
        This OpenCV has no such tracker.
    """

    can_seek = False
    score_is_calibrated = False
    center_inset = 0.0

    def __init__(self, name: OpenCvNetworkName, weights: Path) -> None:
        self._name: OpenCvNetworkName = name
        self._weights = weights
        self._tracker = _new_tracker(name, weights)
        self._xywh: XYWH | None = None

    def __deepcopy__(self, memo: dict[int, Any]) -> OpenCvNetworkTracker:
        if self._xywh is not None:
            raise CopyError(
                f"a tracker {self._name} that has a target cannot be copied, since OpenCV's cannot "
                "be: start a new one on the target's box"
            )
        return self.clone()

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Start on `xywh`, rounded to whole pixels as OpenCV requires.

        Raises
        ------
        ArgumentError
            OpenCV cannot start on this box.
        """
        image = view.render()
        x, y, w, h = xywh
        box = pixel_box((x + view.border, y + view.border, w, h), (image.shape[1], image.shape[0]))
        if min(box[2:]) < _MIN_SIDE:
            raise ArgumentError(
                f"{self._name} cannot track a box of {box[2]}x{box[3]} pixels: draw it larger, or "
                "choose another tracker"
            )
        self._call(ArgumentError, lambda: self._tracker.init(image, box))
        self._xywh = xywh

    def update(self, view: FrameView) -> Track:
        """The target in the next view; its last box, with a score of 0, if it is not found.

        Raises
        ------
        TrackingError
            OpenCV fails on this view.
        """
        if self._xywh is None:
            raise ArgumentError("no target yet: call init(view, xywh) before update")
        image = view.render()
        found, (x, y, w, h) = self._call(TrackingError, lambda: self._tracker.update(image))
        if not found or w <= 0 or h <= 0:
            return Track(self._xywh, score=0.0)
        score = min(max(float(self._tracker.getTrackingScore()), 0.0), 1.0)
        self._xywh = float(x - view.border), float(y - view.border), float(w), float(h)
        return Track(self._xywh, score, evidence=(score,))

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """Not possible: `can_seek` is False."""
        raise ArgumentError(f"{self._name} cannot search around a given box")

    def clone(self) -> OpenCvNetworkTracker:
        """A tracker of the same kind without a target; it reads the files again."""
        return OpenCvNetworkTracker(self._name, self._weights)

    def _call(self, kind: type[ArgumentError | TrackingError], work: Callable[[], Any]) -> Any:
        """The result of OpenCV's `work`; its errors in one line."""
        try:
            return work()
        except cv2.error as error:
            reason = getattr(error, "err", None) or one_line(error)
            raise kind(f"{self._name} failed on this frame: {reason}") from error


def _new_tracker(name: OpenCvNetworkName, weights: Path) -> Any:
    title, patterns = _CLASSES[name]
    if not hasattr(cv2, title):
        raise MissingExtraError(f"this OpenCV {cv2.__version__} has no {title}, which {name} needs")
    parameters = getattr(cv2, f"{title}_Params")()
    files = _files(name, weights, patterns)
    for field, path in files.items():
        check_onnx(path)
        setattr(parameters, field, str(path))
    try:
        with _without_log():
            return getattr(cv2, title).create(parameters)
    except cv2.error as error:
        raise damaged_error(next(iter(files.values()))) from error


@contextmanager
def _without_log() -> Iterator[None]:
    """OpenCV without its log: OpenCV 5 warns of a setting that its trackers make by themselves."""
    logging = cv2.utils.logging
    before = logging.setLogLevel(logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        logging.setLogLevel(before)


def _files(name: str, weights: Path, patterns: dict[str, str]) -> dict[str, Path]:
    """The file of each field; `WeightsError` unless there is exactly one for each."""
    if len(patterns) == 1 and weights.is_file():
        return dict.fromkeys(patterns, weights)
    if not weights.exists():
        raise WeightsError(f"weights {weights} do not exist: give the .onnx files of {name}")
    folder = weights if weights.is_dir() else weights.parent
    found: dict[str, Path] = {}
    for field, pattern in patterns.items():
        files = sorted(folder.glob(pattern))
        if len(files) != 1:
            raise WeightsError(
                f"weights folder {folder} holds {len(files)} files named {pattern}, {name} needs "
                "exactly one"
            )
        found[field] = files[0]
    return found
