"""`CameraMotion`: frames in, the camera's motion out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from ssiam.errors import FrameSizeError
from ssiam.geometry import Image, check_frame
from ssiam.motion.fit import FitName, fit_rigid
from ssiam.motion.flow import follow
from ssiam.motion.keypoints import KeypointName, keypoint_generator, spread
from ssiam.motion.motion import Motion

_GROW: Final = 0.10  # of the target's size, added on each side: its edges move with it
_MIN_POINTS: Final = 12  # agreeing pairs below which a fit proves nothing
_MIN_SHARE: Final = 0.20  # of the pairs that must agree
_TOLERANCE: Final = 1.5 / 640  # px per px of width by which agreeing pairs may differ
_MAX_SHIFT: Final = 0.30  # of the width between two frames; beyond it is a cut
_MAX_ANGLE: Final = 0.35  # rad between two frames


class CameraMotion:
    """Estimates the camera's motion from frame to frame, without delay.

    Keypoints of the previous frame are followed by Lucas-Kanade flow, and a rigid transform is
    fitted to the pairs (eq. 1-4 of the paper). Memory and time per frame do not grow.

    Parameters
    ----------
    keypoints : {"orb", "gftt", "harris", "brisk", "mser"}
        Where points are looked for; ORB is the paper's choice, the others are slower.
    fit : {"robust", "least_squares"}
        How the transform is fitted; least squares is the printed form, and is drawn off by
        anything that moves by itself.

    Examples
    --------
    >>> camera = CameraMotion(keypoints="orb")
    >>> for frame in frames:
    ...     motion = camera.update(frame)
    ...     background_now = ssiam.geometry.map_points(motion.cur_from_prev, background_before)
    """

    def __init__(self, keypoints: KeypointName = "orb", fit: FitName = "robust") -> None:
        self._generate = keypoint_generator(keypoints)
        self._fit: FitName = fit
        self._prev_gray: Image | None = None

    def update(
        self,
        frame: Image,
        exclude: Sequence[float] | Sequence[Sequence[float]] | None = None,
    ) -> Motion:
        """Motion from the frame of the last call to this one.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
        exclude : (x, y, w, h) or several of them, optional
            Boxes of things that move by themselves, the target first of all, where they were in
            the previous frame; raw-frame pixels. No keypoint is taken from them.

        Raises
        ------
        ValueError
            The frame is not (H, W, 3) uint8.
        FrameSizeError
            The frame's size differs from the one before.
        """
        check_frame(frame)
        gray = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
        prev_gray, self._prev_gray = self._prev_gray, np.asarray(gray, dtype=np.uint8)
        size_wh = frame.shape[1], frame.shape[0]
        if prev_gray is None:
            return Motion.none(size_wh, reliable=True)
        if prev_gray.shape != gray.shape:
            raise FrameSizeError(
                f"frame of {size_wh[0]}x{size_wh[1]} pixels after frames of "
                f"{prev_gray.shape[1]}x{prev_gray.shape[0]}: one stream needs one size"
            )
        return self._estimate(prev_gray, self._prev_gray, exclude)

    def _estimate(
        self,
        prev_gray: Image,
        cur_gray: Image,
        exclude: Sequence[float] | Sequence[Sequence[float]] | None,
    ) -> Motion:
        size_wh = cur_gray.shape[1], cur_gray.shape[0]
        found = self._generate(prev_gray, _background(size_wh, exclude))
        prev_xy, cur_xy = follow(prev_gray, cur_gray, spread(found, size_wh))
        if len(prev_xy) < _MIN_POINTS:
            return Motion.none(size_wh)
        cur_from_prev, inliers = fit_rigid(
            prev_xy.astype(np.float64),
            cur_xy.astype(np.float64),
            self._fit,
            tolerance=max(1.0, _TOLERANCE * size_wh[0]),
        )
        motion = Motion(cur_from_prev, inliers, reliable=True, size_wh=size_wh)
        agreed = self._fit == "least_squares" or (
            inliers >= _MIN_SHARE and inliers * len(prev_xy) >= _MIN_POINTS
        )
        return motion if agreed and _plausible(motion) else Motion.none(size_wh)


def _plausible(motion: Motion) -> bool:
    dx, dy, angle = motion.shift_angle
    return bool(np.hypot(dx, dy) <= _MAX_SHIFT * motion.size_wh[0] and abs(angle) <= _MAX_ANGLE)


def _background(
    size_wh: tuple[int, int], exclude: Sequence[float] | Sequence[Sequence[float]] | None
) -> Image | None:
    """Mask (H, W) uint8 that is 0 on the boxes, grown a little; None without boxes."""
    boxes = np.asarray([] if exclude is None else exclude, dtype=np.float64).reshape(-1, 4)
    if len(boxes) == 0:
        return None
    width, height = size_wh
    mask = np.full((height, width), 255, dtype=np.uint8)
    for x, y, w, h in boxes.tolist():
        left, top = max(round(x - _GROW * w), 0), max(round(y - _GROW * h), 0)
        right, bottom = round(x + (1 + _GROW) * w), round(y + (1 + _GROW) * h)
        mask[top : max(bottom, 0), left : max(right, 0)] = 0
    return mask
