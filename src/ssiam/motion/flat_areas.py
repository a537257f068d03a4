"""Blank frames, and flat areas around the scene, such as those around a circular image."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from ssiam.geometry import Image

MAX_BLANK_DEVIATION: Final = 2.5  # gray levels, standard deviation of a blank frame

_DARK: Final = 24  # gray level: brightest border of a stabilized video
_MAX_DIFFERENCE: Final = 2  # gray levels between a flat area and its corner
_MAX_NOISE: Final = 0.5  # gray levels, standard deviation in a flat area; dark scenes have more
_RIM: Final = 3  # px around a flat area that the filters blend with it
_MIN_AREA: Final = 0.005  # share of the frame
_MIN_CONVEXITY: Final = 0.97  # share of its convex hull that a scene fills


def is_blank(gray: Image) -> bool:
    """Whether a frame (H, W) uint8 has one color, apart from noise."""
    return float(cv2.meanStdDev(gray)[1].max()) < MAX_BLANK_DEVIATION


def flat_outside(gray: Image) -> Image | None:
    """Find the area of one color between the corners of a frame and a convex scene.

    Unlike a bar it need not be rectangular: around a circular image, or at the moving borders of
    a stabilized video.

    Parameters
    ----------
    gray : (H, W) uint8
        A small frame.

    Returns
    -------
    (H, W) uint8 or None
        255 in the area and 0 in the scene; None if there is no such area.
    """
    height, width = gray.shape
    corners = [(x, y) for x in (0, width - 1) for y in (0, height - 1)]
    levels = [int(gray[y, x]) for x, y in corners]
    corners_match = sum(abs(level - sorted(levels)[1]) <= _MAX_DIFFERENCE for level in levels) >= 3
    seeds = [c for c, level in zip(corners, levels, strict=True) if level <= _DARK or corners_match]
    if not seeds:
        return None
    fill_mask = np.zeros((height + 2, width + 2), np.uint8)
    flags = 4 | (255 << 8) | cv2.FLOODFILL_MASK_ONLY | cv2.FLOODFILL_FIXED_RANGE
    outside = fill_mask[1:-1, 1:-1]
    for x, y in seeds:
        if not outside[y, x]:
            cv2.floodFill(gray, fill_mask, (x, y), 0, _MAX_DIFFERENCE, _MAX_DIFFERENCE, flags)
    if not _MIN_AREA * gray.size <= cv2.countNonZero(outside) <= (1 - _MIN_AREA) * gray.size:
        return None
    if float(cv2.meanStdDev(gray, mask=outside)[1].max()) > _MAX_NOISE:
        return None
    scene = cv2.bitwise_not(outside)
    outlines, _ = cv2.findContours(scene, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = np.zeros_like(scene)
    cv2.fillConvexPoly(hull, cv2.convexHull(np.concatenate(outlines)), 255)
    is_convex = cv2.countNonZero(scene) >= _MIN_CONVEXITY * cv2.countNonZero(hull)
    return outside if is_convex else None


def without_rim(outside: Image) -> Image:
    """The scene (H, W) around which `flat_outside` is 255, without its edge: 255, else 0."""
    kernel = np.ones((2 * _RIM + 1, 2 * _RIM + 1), np.uint8)
    return np.asarray(cv2.bitwise_not(cv2.dilate(outside, kernel)), dtype=np.uint8)
