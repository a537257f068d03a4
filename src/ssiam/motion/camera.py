"""`CameraMotion`: frames in, the camera's motion out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform, check_frame
from ssiam.motion.fit import FitName, ModelName, fit_motion
from ssiam.motion.flow import coarse_shift, follow
from ssiam.motion.keypoints import KeypointName, Keypoints, keypoint_generator, spread
from ssiam.motion.motion import Motion

_GROW: Final = 0.10  # of the target's size, added on each side: its edges move with it
_MIN_POINTS: Final = 12  # agreeing pairs below which a fit proves nothing
_MIN_SHARE: Final = 0.20  # of the pairs that must agree
_TOLERANCE: Final = 1.5  # px of a picture 640 wide, or of the working size, for agreeing pairs
_SURE_SHARE: Final = 0.50  # of the pairs that agree; below, the flow is started again
_WORKING_WIDTH: Final = 320  # px; large enough to be exact, small enough to see through waves
_LEAST_TRUST: Final = 0.2  # weight of a point at the target's edge; 1 from its size away
_MAX_SHIFT: Final = 0.30  # of the width between two frames; beyond it is a cut
_MAX_ANGLE: Final = 0.35  # rad between two frames


class CameraMotion:
    """Estimates the camera's motion from frame to frame, without delay.

    Keypoints of the previous frame are followed by Lucas-Kanade flow, and a transform is fitted to
    the pairs (eq. 1-4 of the paper). Where few pairs agree, the flow is started again from where
    the middle of the picture went. Memory and time per frame do not grow.

    Parameters
    ----------
    keypoints : {"grid", "orb", "gftt", "harris", "brisk", "mser"}
        Where points are looked for. "grid" takes the best corner of each cell of the frame, 320
        pixels wide: the fastest, and the surest under strong shake. The others are the paper's,
        at full size; ORB is its choice.
    fit : {"robust", "least_squares"}
        How the transform is fitted; least squares is the printed form, and is drawn off by
        anything that moves by itself.
    model : {"rigid", "similarity"}
        "rigid" (the paper's) turns and shifts; "similarity" also zooms.

    Examples
    --------
    >>> camera = CameraMotion(keypoints="orb")
    >>> for frame in frames:
    ...     motion = camera.update(frame)
    ...     background_now = ssiam.geometry.map_points(motion.cur_from_prev, background_before)
    """

    def __init__(
        self,
        keypoints: KeypointName = "grid",
        fit: FitName = "robust",
        model: ModelName = "rigid",
    ) -> None:
        self._generate = keypoint_generator(keypoints)
        self._by_area = keypoints == "grid"
        self._fit: FitName = fit
        self._model: ModelName = model
        self._size_wh: tuple[int, int] | None = None
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
        size_wh = self._size_wh = check_frame(frame, self._size_wh)
        prev_gray, self._prev_gray = self._prev_gray, self._working(frame)
        if prev_gray is None:
            return Motion.none(size_wh, reliable=True)
        boxes = np.asarray([] if exclude is None else exclude, dtype=np.float64).reshape(-1, 4)
        scale = self._prev_gray.shape[1] / size_wh[0]
        found = self._pairs_fit(prev_gray, self._prev_gray, boxes * scale)
        if found is None:
            return Motion.none(size_wh)
        work_from_work, inliers = found
        motion = Motion(_full_size(work_from_work, scale), inliers, True, size_wh)
        return motion if _plausible(motion) else Motion.none(size_wh)

    def _working(self, frame: Image) -> Image:
        """The grey frame, at the working width if points are sampled by area."""
        gray = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
        height, width = gray.shape
        if self._by_area and width > _WORKING_WIDTH:
            size_wh = _WORKING_WIDTH, max(round(height * _WORKING_WIDTH / width), 1)
            gray = cv2.resize(gray, size_wh)
        return np.asarray(gray, dtype=np.uint8)

    def _pairs_fit(
        self, prev_gray: Image, cur_gray: Image, boxes: NDArray[np.float64]
    ) -> tuple[Transform, float] | None:
        """Transform and share of agreeing pairs at the working size; None if they prove nothing."""
        size_wh = cur_gray.shape[1], cur_gray.shape[0]
        points = spread(self._generate(prev_gray, _background(size_wh, boxes)), size_wh)
        first = self._attempt(points, prev_gray, cur_gray, boxes, None)
        if first is None or first[1] < _SURE_SHARE:
            shift_xy = coarse_shift(prev_gray, cur_gray)
            second = self._attempt(points, prev_gray, cur_gray, boxes, shift_xy)
            if first is None or (second is not None and second[2] > first[2]):
                first = second
        if first is None:
            return None
        work_from_work, inliers, agreeing = first
        agreed = inliers >= _MIN_SHARE and agreeing >= _MIN_POINTS
        return (work_from_work, inliers) if agreed or self._fit == "least_squares" else None

    def _attempt(
        self,
        points: Keypoints,
        prev_gray: Image,
        cur_gray: Image,
        boxes: NDArray[np.float64],
        shift_xy: tuple[float, float] | None,
    ) -> tuple[Transform, float, float] | None:
        """Transform, share and number of agreeing pairs, with the flow started at `shift_xy`."""
        prev_xy, cur_xy = follow(prev_gray, cur_gray, points, shift_xy)
        if len(prev_xy) < _MIN_POINTS:
            return None
        work_from_work, inliers = fit_motion(
            prev_xy.astype(np.float64),
            cur_xy.astype(np.float64),
            self._fit,
            _TOLERANCE if self._by_area else max(_TOLERANCE * cur_gray.shape[1] / 640, 1.0),
            model=self._model,
            trust=_trust(prev_xy, boxes),
        )
        return work_from_work, inliers, inliers * len(prev_xy)


def _full_size(work_from_work: Transform, scale: float) -> Transform:
    """A transform of the working size as one of the frame; pixel centres lie at whole numbers."""
    offset = (scale - 1) / 2
    work_from_frame = np.array([[scale, 0, offset], [0, scale, offset], [0, 0, 1]])
    frame_from_work = np.linalg.inv(work_from_frame)
    return np.asarray(frame_from_work @ work_from_work @ work_from_frame, dtype=np.float64)


def _trust(points: Keypoints, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights (N,) of points: what lies within a target's size of it may well move with it."""
    distance = np.ones(len(points))
    for x, y, w, h in boxes:
        away = np.maximum(np.maximum((x, y) - points, points - (x + w, y + h)), 0)
        distance = np.minimum(distance, np.hypot(away[:, 0], away[:, 1]) / max(w, h))
    return np.asarray(np.maximum(distance, _LEAST_TRUST), dtype=np.float64)


def _plausible(motion: Motion) -> bool:
    dx, dy, angle = motion.shift_angle
    return bool(np.hypot(dx, dy) <= _MAX_SHIFT * motion.size_wh[0] and abs(angle) <= _MAX_ANGLE)


def _background(size_wh: tuple[int, int], boxes: NDArray[np.float64]) -> Image | None:
    """Mask (H, W) uint8 that is 0 on the boxes, grown a little; None without boxes."""
    if len(boxes) == 0:
        return None
    width, height = size_wh
    mask = np.full((height, width), 255, dtype=np.uint8)
    for x, y, w, h in boxes.tolist():
        left, top = max(round(x - _GROW * w), 0), max(round(y - _GROW * h), 0)
        right, bottom = round(x + (1 + _GROW) * w), round(y + (1 + _GROW) * h)
        mask[top : max(bottom, 0), left : max(right, 0)] = 0
    return mask
