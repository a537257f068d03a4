"""Camera motion from keypoints: detect, follow, fit (eq. 1-4 of the paper)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.motion.content import flat_outside, shows_nothing, without_rim
from ssiam.motion.fit import FitName, fit_motion
from ssiam.motion.models import ModelName
from ssiam.motion.motion import Motion, plausible

GeneratorName: TypeAlias = Literal["orb", "gftt", "harris", "brisk", "mser"]
Keypoints: TypeAlias = NDArray[np.float32]
_Generate: TypeAlias = Callable[[Image, Image | None], Keypoints]

_ORB_POINTS = 500
_ORB_LEVELS = 2  # flow needs places, not scales: 2 octaves cost a fifth of 8 levels of 1.2
_ORB_SCALE = 2.0
_ORB_PATCH = 9  # px, for the orientation, which flow does not need
_GFTT_POINTS = 200
_GFTT_QUALITY = 0.01  # share of the strongest corner's response
_GFTT_DISTANCE = 10.0  # px between points
_BRISK_THRESHOLD = 40  # grey levels
_CELLS_XY = (16, 12)  # at most one point in each cell of the frame


class KeypointGenerator:
    """Generator of keypoints by its name in Table 2 of the paper.

    Called with a grey frame (H, W) uint8 and a mask (H, W) uint8 or None (points only where it
    is not 0), it returns (N, 2) float32 points, x and y in pixels, the strongest first. A copy
    has a detector of its own, for those of OpenCV work in buffers that they keep.

    Threads: one thread at a time.

    Parameters
    ----------
    name : {"orb", "gftt", "harris", "brisk", "mser"}
    """

    def __init__(self, name: GeneratorName) -> None:
        self._name: GeneratorName = name
        self._generate = _generator(name)

    def __call__(self, gray: Image, mask: Image | None) -> Keypoints:
        """The points of a grey frame."""
        return self._generate(gray, mask)

    def __reduce__(self) -> tuple[type[KeypointGenerator], tuple[GeneratorName]]:
        return KeypointGenerator, (self._name,)


def spread(points: Keypoints, size_wh: tuple[int, int]) -> Keypoints:
    """The strongest point of each cell of a grid over the frame of (width, height) pixels.

    Detectors crowd their points on the most textured thing in view, which may well be the one
    thing that moves by itself; a rigid fit wants them all over the picture.
    """
    columns, rows = _CELLS_XY
    column, row = (points * np.divide(_CELLS_XY, size_wh)).astype(np.intp).T
    strongest = np.full(columns * rows, -1)
    order = np.arange(len(points))[::-1]  # the strongest is written last, and stays
    strongest[(row * columns + column)[::-1]] = order
    spread_out: Keypoints = points[strongest[strongest >= 0]]
    return spread_out


def _generator(name: GeneratorName) -> _Generate:
    match name:
        case "orb":
            return _detector(_orb())
        case "brisk":
            return _detector(_brisk())
        case "mser":
            return _detector(cv2.MSER.create())
        case "gftt":
            return _corners(harris=False)
        case "harris":
            return _corners(harris=True)


def _orb() -> Any:
    """ORB without what only descriptors need; ranked by FAST's score."""
    return cv2.ORB.create(
        _ORB_POINTS,
        _ORB_SCALE,
        _ORB_LEVELS,
        edgeThreshold=_ORB_PATCH,
        patchSize=_ORB_PATCH,
        scoreType=cv2.ORB_FAST_SCORE,
    )


def _brisk() -> Any:
    """BRISK, which OpenCV 5 moved to the contributed modules."""
    contributed: Any = cv2.xfeatures2d
    brisk = getattr(cv2, "BRISK", None) or contributed.BRISK
    return brisk.create(_BRISK_THRESHOLD)


def _detector(detector: Any) -> _Generate:
    def generate(gray: Image, mask: Image | None) -> Keypoints:
        found = detector.detect(gray, mask)
        response = np.array([point.response for point in found], dtype=np.float32)
        order = np.argsort(-response, kind="stable")
        xy = np.asarray(cv2.KeyPoint.convert(found), dtype=np.float32).reshape(-1, 2)
        return xy[order]

    return generate


def _corners(*, harris: bool) -> _Generate:
    def generate(gray: Image, mask: Image | None) -> Keypoints:
        found = cv2.goodFeaturesToTrack(
            gray,
            _GFTT_POINTS,
            _GFTT_QUALITY,
            _GFTT_DISTANCE,
            mask=mask,
            useHarrisDetector=harris,
        )
        return np.asarray([] if found is None else found, dtype=np.float32).reshape(-1, 2)

    return generate


_WINDOW = (17, 17)  # px; a quarter faster than the usual 21, and as exact here
_LEVELS = 4  # 17 px at 1/16 of the size follows shifts of some 100 px
_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.03)  # iterations, px


def follow(
    prev_gray: Image,
    cur_gray: Image,
    prev_xy: Keypoints,
) -> tuple[Keypoints, Keypoints]:
    """Points of the previous frame, and where they are in this one.

    Takes and returns (N, 2) float32 pixels; points that were lost, or that left the frame, are
    left out of both results.
    """
    if len(prev_xy) == 0:
        return prev_xy, prev_xy
    cur_xy, found, _ = cv2.calcOpticalFlowPyrLK(
        prev_gray,
        cur_gray,
        prev_xy,
        np.empty_like(prev_xy),
        winSize=_WINDOW,
        maxLevel=_LEVELS,
        criteria=_STOP,
    )
    height, width = cur_gray.shape
    inside = ((cur_xy >= 0) & (cur_xy <= (width - 1, height - 1))).all(axis=1)
    kept = found.ravel().astype(bool) & inside
    return prev_xy[kept], np.asarray(cur_xy, dtype=np.float32)[kept]


_MIN_POINTS: Final = 12  # agreeing pairs below which a fit proves nothing
_MIN_SHARE: Final = 0.20  # of the pairs that must agree
_TOLERANCE: Final = 1.5 / 640  # of the longer side, for agreeing pairs
_LONGER_SIDE: Final = 320  # px of the small frame on which the scene's outline is found
_SPARSE: Final = 8  # px between those that tell whether a frame shows anything
_LEAST_TOLERANCE: Final = 1.0  # px


class PointMotion:
    """Camera motion of frames of one size, from keypoints of the previous frame."""

    def __init__(
        self,
        size_wh: tuple[int, int],
        generate: KeypointGenerator,
        fit: FitName,
        model: ModelName,
    ) -> None:
        self._size_wh = size_wh
        self._generate = generate
        self._fit: FitName = fit
        self._model: ModelName = model
        self._tolerance = max(_TOLERANCE * max(size_wh), _LEAST_TOLERANCE)
        self._prev_gray: Image | None = None

    def see(self, frame: Image) -> None:
        """Take a frame (H, W, 3) uint8 as the previous one."""
        self._prev_gray = np.asarray(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), dtype=np.uint8)

    def motion(self, frame: Image, boxes: NDArray[np.float64]) -> Motion:
        """From the previous frame to this one; no point is taken from `boxes`.

        These are (N, 4), low xy, high xy, pixels. Frames that show nothing are passed over, as by
        `DirectMotion`.
        """
        prev_gray = self._prev_gray
        cur_gray = np.asarray(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        if prev_gray is None:
            self._prev_gray = cur_gray
            return Motion.none(self._size_wh, reliable=True)
        if shows_nothing(cur_gray[::_SPARSE, ::_SPARSE].copy()):
            return Motion.none(self._size_wh)
        self._prev_gray = cur_gray
        points = spread(
            self._generate(prev_gray, self._background(prev_gray, boxes)), self._size_wh
        )
        prev_xy, cur_xy = follow(prev_gray, cur_gray, points)
        if len(prev_xy) < _MIN_POINTS:
            return Motion.none(self._size_wh)
        cur_from_prev, inliers = fit_motion(
            prev_xy.astype(np.float64),
            cur_xy.astype(np.float64),
            self._fit,
            self._tolerance,
            model=self._model,
        )
        motion = Motion(cur_from_prev, inliers, True, self._size_wh)
        agreed = inliers >= _MIN_SHARE and inliers * len(prev_xy) >= _MIN_POINTS
        sure = agreed or self._fit == "least_squares"
        return motion if sure and plausible(motion) else Motion.none(self._size_wh)

    def _background(self, gray: Image, boxes: NDArray[np.float64]) -> Image | None:
        """Mask (H, W) uint8, 0 on the boxes and outside of the scene; None if all may vote."""
        scale = max(max(self._size_wh) / _LONGER_SIDE, 1.0)
        small_wh = tuple(max(round(side / scale), 1) for side in self._size_wh)
        outside = flat_outside(np.asarray(cv2.resize(gray, small_wh), dtype=np.uint8))
        if outside is None and len(boxes) == 0:
            return None
        if outside is None:
            mask = np.full(gray.shape, 255, dtype=np.uint8)
        else:
            scene = cv2.resize(without_rim(outside), self._size_wh, interpolation=cv2.INTER_NEAREST)
            mask = np.asarray(scene, dtype=np.uint8)
        for left, top, right, bottom in np.maximum(np.rint(boxes), 0).astype(int).tolist():
            mask[top:bottom, left:right] = 0
        return mask
