"""Camera motion from keypoints: detect, follow, fit (eq. 1-4 of the paper)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import MissingExtraError
from ssiam.geometry import Image
from ssiam.motion.fit import FitName, fit_motion
from ssiam.motion.flat_areas import flat_outside, is_blank, without_rim
from ssiam.motion.models import ModelName
from ssiam.motion.motion import Motion
from ssiam.motion.pyramid import as_gray

GeneratorName: TypeAlias = Literal["orb", "gftt", "harris", "brisk", "mser"]
Keypoints: TypeAlias = NDArray[np.float32]
_Detect: TypeAlias = Callable[[Image, Image | None], Keypoints]

# Detectors
_ORB_POINTS: Final = 500
_ORB_LEVELS: Final = 2  # flow needs no scale; 2 octaves take a fifth of the time of 8 levels of 1.2
_ORB_SCALE: Final = 2.0
_ORB_PATCH: Final = 9  # px, for the orientation, which flow does not need
_GFTT_POINTS: Final = 200
_GFTT_QUALITY: Final = 0.01  # share of the strongest corner's response
_GFTT_DISTANCE: Final = 10.0  # px between points
_BRISK_THRESHOLD: Final = 40  # gray levels
_CELLS_XY: Final = (16, 12)  # at most one point in each cell of the frame

# Lucas-Kanade flow
_WINDOW: Final = (17, 17)  # px; a quarter faster than the default 21, and as accurate here
_LEVELS: Final = 4  # 17 px at 1/16 of the size follow shifts of about 100 px
_STOP: Final = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.03)  # iterations, px

# Fit
_MIN_POINTS: Final = 12  # inliers of a reliable fit
_MIN_SHARE: Final = 0.20  # share of inliers of a reliable fit
_TOLERANCE: Final = 1.5 / 640  # of the longer side: largest error of an inlier
_MIN_TOLERANCE: Final = 1.0  # px

_LONGER_SIDE: Final = 320  # px of the small frame in which flat areas are searched for
_BLANK_STRIDE: Final = 8  # px between the samples that decide whether a frame is blank


class KeypointMotion:
    """Camera motion of frames of one size, from keypoints of the previous frame.

    Parameters
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.
    generator : KeypointGenerator
    fit : {"robust", "least_squares"}
    model : {"rigid", "similarity", "affine", "homography"}
    spread : bool
        Whether only the strongest point of each cell of a grid is used.
    static : (H, W) uint8, optional
        255 at pixels that are not used, else 0.
    """

    def __init__(
        self,
        size_wh: tuple[int, int],
        generator: KeypointGenerator,
        fit: FitName,
        model: ModelName,
        spread: bool = True,
        static: Image | None = None,
    ) -> None:
        # The flow of a point compares all pixels of its window.
        self._static = None if static is None else cv2.dilate(static, np.ones(_WINDOW, np.uint8))
        self._size_wh = size_wh
        self._generator = generator
        self._fit: FitName = fit
        self._model: ModelName = model
        self._spread_points = spread
        self._tolerance = max(_TOLERANCE * max(size_wh), _MIN_TOLERANCE)
        self._prev_gray: Image | None = None

    def set_previous(self, frame: Image) -> None:
        """Use a frame, (H, W, 3) or (H, W) uint8, as the previous one."""
        self._prev_gray = as_gray(frame)

    def estimate(self, frame: Image, boxes: NDArray[np.float64]) -> Motion:
        """The motion from the previous frame to this one, without the points in `boxes`.

        Boxes are (N, 4): low xy, high xy, pixels of the previous frame. Blank frames are skipped,
        as in `DirectMotion`.
        """
        prev_gray = self._prev_gray
        cur_gray = as_gray(frame)
        if prev_gray is None:
            self._prev_gray = cur_gray
            return Motion.none(self._size_wh, reliable=True)
        if is_blank(cur_gray[::_BLANK_STRIDE, ::_BLANK_STRIDE].copy()):
            return Motion.none(self._size_wh)
        self._prev_gray = cur_gray
        points = self._generator(prev_gray, self._background(prev_gray, boxes))
        if self._spread_points:
            points = _spread(points, self._size_wh)
        prev_xy, cur_xy = _follow(prev_gray, cur_gray, points)
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
        has_consensus = inliers >= _MIN_SHARE and inliers * len(prev_xy) >= _MIN_POINTS
        reliable = has_consensus or self._fit == "least_squares"
        return motion if reliable and motion.is_plausible else Motion.none(self._size_wh)

    def _background(self, gray: Image, boxes: NDArray[np.float64]) -> Image | None:
        """Mask (H, W) uint8, 0 in the boxes and outside the scene; None to use the whole frame."""
        scale = max(max(self._size_wh) / _LONGER_SIDE, 1.0)
        small_wh = tuple(max(round(side / scale), 1) for side in self._size_wh)
        outside = flat_outside(np.asarray(cv2.resize(gray, small_wh), dtype=np.uint8))
        if outside is None and len(boxes) == 0 and self._static is None:
            return None
        if outside is None:
            mask = np.full(gray.shape, 255, dtype=np.uint8)
        else:
            scene = cv2.resize(without_rim(outside), self._size_wh, interpolation=cv2.INTER_NEAREST)
            mask = np.asarray(scene, dtype=np.uint8)
        for left, top, right, bottom in np.maximum(np.rint(boxes), 0).astype(int).tolist():
            mask[top:bottom, left:right] = 0
        if self._static is not None:
            mask[self._static > 0] = 0
        return mask


class KeypointGenerator:
    """A keypoint detector of the paper's Table 2.

    Call it with a gray frame (H, W) uint8 and a mask (H, W) uint8 or None (detect only where the
    mask is not 0). It returns points (N, 2) float32, x and y in pixels, the strongest first.

    Threads: one thread at a time for each object. A copy has a separate OpenCV detector, because
    those keep internal buffers.

    Parameters
    ----------
    name : {"orb", "gftt", "harris", "brisk", "mser"}
    """

    def __init__(self, name: GeneratorName) -> None:
        self._name: GeneratorName = name
        self._detect = _detector(name)

    def __call__(self, gray: Image, mask: Image | None) -> Keypoints:
        """Keypoints (N, 2) float32 of a gray frame (H, W) uint8."""
        return self._detect(gray, mask)

    def __reduce__(self) -> tuple[type[KeypointGenerator], tuple[GeneratorName]]:
        return KeypointGenerator, (self._name,)


def _detector(name: GeneratorName) -> _Detect:
    match name:
        case "orb":
            return _feature_detector(_orb())
        case "brisk":
            return _feature_detector(_brisk())
        case "mser":
            return _feature_detector(cv2.MSER.create())
        case "gftt":
            return _corner_detector(harris=False)
        case "harris":
            return _corner_detector(harris=True)


def _orb() -> Any:
    """ORB without the work that only descriptors need; ranked by the FAST score."""
    return cv2.ORB.create(
        _ORB_POINTS,
        _ORB_SCALE,
        _ORB_LEVELS,
        edgeThreshold=_ORB_PATCH,
        patchSize=_ORB_PATCH,
        scoreType=cv2.ORB_FAST_SCORE,
    )


def _brisk() -> Any:
    """BRISK; OpenCV 5 moved it to the contributed modules."""
    contributed: Any = getattr(cv2, "xfeatures2d", None)
    brisk = getattr(cv2, "BRISK", None) or getattr(contributed, "BRISK", None)
    if brisk is None:
        raise MissingExtraError(
            f"this OpenCV {cv2.__version__} has no BRISK: pip install --force-reinstall "
            "opencv-contrib-python-headless (docs/how-to/install.md)"
        )
    return brisk.create(_BRISK_THRESHOLD)


def _feature_detector(detector: Any) -> _Detect:
    def detect(gray: Image, mask: Image | None) -> Keypoints:
        keypoints = detector.detect(gray, mask)
        response = np.array([point.response for point in keypoints], dtype=np.float32)
        order = np.argsort(-response, kind="stable")
        xy = np.asarray(cv2.KeyPoint.convert(keypoints), dtype=np.float32).reshape(-1, 2)
        return xy[order]

    return detect


def _corner_detector(*, harris: bool) -> _Detect:
    def detect(gray: Image, mask: Image | None) -> Keypoints:
        corners = cv2.goodFeaturesToTrack(
            gray,
            _GFTT_POINTS,
            _GFTT_QUALITY,
            _GFTT_DISTANCE,
            mask=mask,
            useHarrisDetector=harris,
        )
        return np.asarray([] if corners is None else corners, dtype=np.float32).reshape(-1, 2)

    return detect


def _spread(points: Keypoints, size_wh: tuple[int, int]) -> Keypoints:
    """The strongest point of each cell of a grid over the frame of (width, height) pixels.

    Detectors concentrate their points on the most textured object, which may move independently of
    the camera; a rigid fit needs points all over the frame.
    """
    columns, rows = _CELLS_XY
    column, row = (points * np.divide(_CELLS_XY, size_wh)).astype(np.intp).T
    strongest = np.full(columns * rows, -1)
    order = np.arange(len(points))[::-1]  # the strongest is written last, over the others
    strongest[(row * columns + column)[::-1]] = order
    spread: Keypoints = points[strongest[strongest >= 0]]
    return spread


def _follow(prev_gray: Image, cur_gray: Image, prev_xy: Keypoints) -> tuple[Keypoints, Keypoints]:
    """Track points of the previous frame into this one by Lucas-Kanade flow.

    Takes and returns (N, 2) float32 pixels (eq. 1 and 2, on a pyramid). Points that were lost or
    left the frame are removed from both results.
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
    tracked = found.ravel().astype(bool) & inside
    return prev_xy[tracked], np.asarray(cur_xy, dtype=np.float32)[tracked]
