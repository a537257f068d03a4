"""The keypoint generators that the paper compares (Table 2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image

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
