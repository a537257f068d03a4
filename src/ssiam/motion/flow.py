"""Lucas-Kanade optical flow of sparse points (eq. 1 and 2), on a pyramid."""

from __future__ import annotations

import cv2
import numpy as np

from ssiam.geometry import Image
from ssiam.motion.keypoints import Keypoints

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
