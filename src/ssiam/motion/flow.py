"""Lucas-Kanade optical flow of sparse points (eq. 1 and 2), on a pyramid."""

from __future__ import annotations

import cv2
import numpy as np

from ssiam.geometry import Image
from ssiam.motion.keypoints import Keypoints

_WINDOW = (17, 17)  # px; a quarter faster than the usual 21, and as exact here
_LEVELS = 4  # 17 px at 1/16 of the size follows shifts of some 100 px
_LEVELS_FROM_SHIFT = 2
_COARSE_WIDTH = 80  # px
_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.03)  # iterations, px


def follow(
    prev_gray: Image,
    cur_gray: Image,
    prev_xy: Keypoints,
    shift_xy: tuple[float, float] | None = None,
) -> tuple[Keypoints, Keypoints]:
    """Points of the previous frame, and where they are in this one.

    Takes and returns (N, 2) float32 pixels; points that were lost, or that left the frame, are
    left out of both results. With `shift_xy` the search starts that far off, at fewer levels.
    """
    if len(prev_xy) == 0:
        return prev_xy, prev_xy
    start_xy = prev_xy + np.array(shift_xy or (0, 0), dtype=np.float32)
    cur_xy, found, _ = cv2.calcOpticalFlowPyrLK(
        prev_gray,
        cur_gray,
        prev_xy,
        start_xy,
        winSize=_WINDOW,
        maxLevel=_LEVELS if shift_xy is None else _LEVELS_FROM_SHIFT,
        criteria=_STOP,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    height, width = cur_gray.shape
    inside = ((cur_xy >= 0) & (cur_xy <= (width - 1, height - 1))).all(axis=1)
    kept = found.ravel().astype(bool) & inside
    return prev_xy[kept], np.asarray(cur_xy, dtype=np.float32)[kept]


def coarse_shift(prev_gray: Image, cur_gray: Image) -> tuple[float, float]:
    """Where the middle of the previous frame is found in this one, at 80 px of width: (dx, dy).

    An exhaustive search, which no jump is too large for; it costs a tenth of the flow.
    """
    height, width = prev_gray.shape
    small = _COARSE_WIDTH, max(round(height * _COARSE_WIDTH / width), 8)
    prev, cur = (cv2.resize(g, small, interpolation=cv2.INTER_AREA) for g in (prev_gray, cur_gray))
    x, y = small[0] // 4, small[1] // 4
    match = cv2.matchTemplate(cur, prev[y : small[1] - y, x : small[0] - x], cv2.TM_CCOEFF_NORMED)
    _, _, _, (best_x, best_y) = cv2.minMaxLoc(match)
    scale = width / _COARSE_WIDTH
    return (best_x - x) * scale, (best_y - y) * scale
