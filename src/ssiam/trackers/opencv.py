"""OpenCV's trackers CSRT, KCF and MIL, which need no weights."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from threading import Lock
from typing import Any, Final, Literal, TypeAlias

import cv2

from ssiam.errors import ArgumentError, CopyError, MissingExtraError, TrackingError, one_line
from ssiam.geometry import XYWH, Image
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.confidence import AppearanceModel, Confidence

OpenCvName: TypeAlias = Literal["csrt", "kcf", "mil"]

_CONFIDENCE: Final[dict[OpenCvName, Confidence]] = {  # of similarity to first, recent appearance
    "csrt": Confidence((7.2, 3.9), -6.2),
    "kcf": Confidence((6.3, 1.4), -4.9),
    "mil": Confidence((7.2, 3.9), -6.2),
}
_UPDATE_ABOVE: Final = 0.6  # score above which a box becomes the recent appearance
_RESTART_ABOVE: Final = 0.4  # score above which a tracker is restarted on a box found by `seek`
_SEEK_REACH: Final = 0.7  # target sizes, maximum distance in `seek` from the given box
_KCF_RESEEK: Final = 0.2  # score of KCF up to which a second search is worth its cost
# Rendered margin on each side of the last box, in its longer sides. The trackers read no more.
_MARGIN: Final[dict[OpenCvName, float]] = {"csrt": 8.0, "kcf": 3.0, "mil": 3.0}
_EXTRA_MARGIN: Final = 40.0  # px, added to that margin

_SEED: Final = 1  # any value will do
_RAND_STATE: Final = 128  # bytes of glibc's generator state, its default
# Numbers of parts of MIL's features along x and y. A feature in the box has at least 9 px^2.
_MIL_PARTS: Final = ((1, 2), (2, 1), (1, 4), (4, 1), (2, 2))
_MIL_MIN_AREA: Final = 9
_MIL_LOCK = Lock()


class OpenCvTracker(CompleteTracker):
    """One of OpenCV's trackers on the rendered view.

    OpenCV's trackers return no score. CSRT and KCF return whether they have found the target; if
    not, the last box is kept. The score is computed from an `AppearanceModel`.

    Results are repeatable; for MIL, see `DeterministicMil`.

    Threads: one thread at a time for each object; MIL trackers wait for each other.

    Parameters
    ----------
    name : {"csrt", "kcf", "mil"}
    """

    def __init__(self, name: OpenCvName) -> None:
        self._name: OpenCvName = name
        self._tracker: Any = None
        self._appearance: AppearanceModel | None = None
        self._xywh: XYWH = (0.0, 0.0, 0.0, 0.0)

    def __deepcopy__(self, memo: dict[int, Any]) -> OpenCvTracker:
        if self._tracker is not None:
            raise CopyError(
                f"a tracker {self._name} that has a target cannot be copied, since OpenCV's cannot "
                "be: start a new one on the target's box"
            )
        return self.clone()

    @property
    def can_seek(self) -> bool:
        """Only for KCF: the search of CSRT and MIL is more reliable than `seek`."""
        return self._name == "kcf"

    @property
    def reseek_below(self) -> float:
        """Score up to which a second search in the same frame is worth its cost."""
        return _KCF_RESEEK

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Start on `xywh`, rounded to whole pixels as OpenCV requires.

        Raises
        ------
        ArgumentError
            OpenCV cannot start on this box: it is too thin, too small or too large. The earlier
            target is kept.
        """
        appearance = AppearanceModel(view, xywh)
        self._start(view, xywh)
        self._appearance = appearance

    def update(self, view: FrameView) -> Track:
        """The target in the next view.

        Raises
        ------
        TrackingError
            OpenCV fails on this view.
        """
        appearance = self._current_appearance()
        image = view.render(self._rendered_area)
        try:
            found, (x, y, w, h) = self._tracker.update(image)
        except cv2.error as error:
            reason = getattr(error, "err", None) or one_line(error)
            raise TrackingError(f"{self._name} failed on this frame: {reason}") from error
        if not found or w <= 0 or h <= 0:
            return Track(self._xywh, score=0.0)
        # The rendered image is offset by the border (eq. 9).
        self._xywh = float(x - view.border), float(y - view.border), float(w), float(h)
        track = self._scored(appearance, view, self._xywh)
        if track.score > _UPDATE_ABOVE:
            appearance.update(view, self._xywh)
        return track

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The box near `xywh` that is most similar to the target.

        If its score is high enough, the tracker is restarted on it.
        """
        appearance = self._current_appearance()
        track = self._scored(appearance, view, appearance.find(view, xywh, _SEEK_REACH))
        if track.score > _RESTART_ABOVE and _is_inside(track.box, view):
            with suppress(ArgumentError):
                self._start(view, track.box)
        return track

    def clone(self) -> OpenCvTracker:
        """A tracker of the same kind without a target."""
        return OpenCvTracker(self._name)

    def _current_appearance(self) -> AppearanceModel:
        if self._appearance is None:
            raise ArgumentError("no target yet: call init(view, xywh) before update or seek")
        return self._appearance

    @property
    def _rendered_area(self) -> XYWH:
        x, y, w, h = self._xywh
        margin = _MARGIN[self._name] * max(w, h) + _EXTRA_MARGIN
        return x - margin, y - margin, w + 2 * margin, h + 2 * margin

    def _start(self, view: FrameView, xywh: XYWH) -> None:
        image = view.render()
        x, y, w, h = xywh
        box = pixel_box((x + view.border, y + view.border, w, h), (image.shape[1], image.shape[0]))
        tracker = _new_tracker(self._name)
        try:
            tracker.init(image, box)
        except cv2.error as error:
            height, width = image.shape[:2]
            raise ArgumentError(
                f"{self._name} cannot track a box of {box[2]}x{box[3]} pixels in frames of "
                f"{width}x{height}: it is too thin, too small or too large; draw another box, or "
                "choose another tracker"
            ) from error
        self._tracker, self._xywh = tracker, xywh

    def _scored(self, appearance: AppearanceModel, view: FrameView, xywh: XYWH) -> Track:
        evidence = appearance.similarity(view, xywh)
        return Track(xywh, score=_CONFIDENCE[self._name].probability(evidence), evidence=evidence)


def pixel_box(xywh: Sequence[float], size_wh: tuple[int, int]) -> tuple[int, int, int, int]:
    """A box in whole pixels, clipped to an image of (width, height); at least 1 x 1 pixel."""
    x, y, w, h = xywh
    width, height = size_wh
    left, top = min(max(round(x), 0), width - 1), min(max(round(y), 0), height - 1)
    right = min(max(round(x) + round(w), left + 1), width)
    bottom = min(max(round(y) + round(h), top + 1), height)
    return left, top, right - left, bottom - top


def _is_inside(xywh: XYWH, view: FrameView) -> bool:
    """Whether the central half of a box (w / 2, h / 2) is inside of the rendered image."""
    x, y, w, h = xywh
    n, (width, height) = view.border, view.size_wh
    return (
        x + n + w / 4 >= 0
        and y + n + h / 4 >= 0
        and (x + 3 * w / 4 <= width + n and y + 3 * h / 4 <= height + n)
    )


class DeterministicMil:
    """`cv2.TrackerMIL` with the same random numbers in every run.

    MIL draws its features with the C library's `rand`, and its samples with the OpenCV generator of
    the thread that starts it; it seeds neither. Its updates use arrays that all MIL trackers of a
    process share (modules/video/src/tracking of OpenCV).

    OpenCV's generators of other threads are not changed. The C library's generator is restored on
    Linux with glibc and on Windows; on other systems its sequence restarts. A call of `rand` in
    another thread during `init` changes the result.

    Threads: one thread at a time for each object; calls on several objects wait for each other.
    """

    def __init__(self) -> None:
        self._tracker: Any = cv2.TrackerMIL.create()

    def init(self, image: Image, box: tuple[int, int, int, int]) -> None:
        """Start on a box (x, y, w, h) of whole pixels.

        Raises
        ------
        ArgumentError
            No feature fits into the box: OpenCV would search for one in an endless loop.
        """
        _, _, w, h = box
        if not any(
            columns * ((w - 1) // columns) * rows * ((h - 1) // rows) >= _MIL_MIN_AREA
            for columns, rows in _MIL_PARTS
        ):
            raise ArgumentError(
                f"mil cannot track a box of {w}x{h} pixels: draw it larger, or choose another "
                "tracker"
            )
        # OpenCV has one generator for each thread: seeding that of a new thread affects no other.
        with _MIL_LOCK, ThreadPoolExecutor(1) as thread:
            thread.submit(self._start, image, box).result()

    def update(self, image: Image) -> tuple[bool, tuple[int, int, int, int]]:
        """Whether the target is found, and its box (x, y, w, h) in whole pixels."""
        with _MIL_LOCK:
            found, box = self._tracker.update(image)
        return found, box

    def _start(self, image: Image, box: tuple[int, int, int, int]) -> None:
        cv2.setRNGSeed(_SEED)
        with _seeded_rand():
            self._tracker.init(image, box)


@contextmanager
def _seeded_rand() -> Iterator[None]:
    """Seed the C library's `rand`, and restore its state afterwards where that is possible."""
    if sys.platform == "win32":  # each new thread starts with the same seed
        yield
        return
    library = ctypes.CDLL(None)
    if not hasattr(library, "gnu_get_libc_version"):
        library.srand(_SEED)
        yield
        return
    library.initstate.argtypes = (ctypes.c_uint, ctypes.c_void_p, ctypes.c_size_t)
    library.initstate.restype = library.setstate.restype = ctypes.c_void_p
    library.setstate.argtypes = (ctypes.c_void_p,)
    state = ctypes.create_string_buffer(_RAND_STATE)
    before = library.initstate(_SEED, state, _RAND_STATE)
    try:
        yield
    finally:
        library.setstate(before)


_CLASSES: Final[dict[OpenCvName, str]] = {"csrt": "TrackerCSRT", "kcf": "TrackerKCF"}


def _new_tracker(name: OpenCvName) -> Any:
    if name == "mil":
        return DeterministicMil()
    try:
        return getattr(cv2, _CLASSES[name]).create()
    except AttributeError as error:
        raise MissingExtraError(
            f"this OpenCV {cv2.__version__} has no {name}: another OpenCV package has overwritten "
            "that of ssiam; pip install --force-reinstall opencv-contrib-python-headless "
            "(docs/how-to/install.md)"
        ) from error
