"""The camera's motion from keypoints, as the paper has it: detect, follow, fit (eq. 1-4)."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.motion.content import flat_outside, shows_nothing, without_rim
from ssiam.motion.fit import FitName, fit_motion
from ssiam.motion.flow import follow
from ssiam.motion.keypoints import KeypointGenerator, spread
from ssiam.motion.models import ModelName
from ssiam.motion.motion import Motion, plausible

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
