"""Rotated boxes of masks: SiamMask's minimum-area rectangle, and SiamMask_E's ellipse fit.

SiamMask_E is from Chen and Tsotsos, "Fast Visual Object Tracking using Ellipse Fitting for Rotated
Bounding Boxes" (arXiv 1907.03892). The steps below are those of its Fig. 3, in the authors' order.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Points

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]
Sides = tuple[float, float, float, float]  # left, top, right, bottom

MIN_AREA: Final = 100.0  # px^2; smaller contours are ignored, as in the references
_STEP: Final = 0.02  # share of the box's width or height by which a side moves inwards


def rectangle_box(mask: Mask, min_area: float = MIN_AREA) -> Points | None:
    """Minimum-area rectangle around the mask's largest connected component.

    Parameters
    ----------
    mask : (H, W) bool
    min_area : float
        Area that the component must exceed, px^2.

    Returns
    -------
    (4, 2) float64 or None
        Corners in the mask's pixels; None if no component is large enough.
    """
    contour = _largest_contour(mask, min_area)
    return None if contour is None else _rectangle(contour)


def ellipse_box(mask: Mask, factor: float | None = None) -> Points | None:
    """SiamMask_E's rotated box: the angle of the fitted ellipse, and sides from ellipse and mask.

    Parameters
    ----------
    mask : (H, W) bool
    factor : float, optional
        The authors' alpha: in the refinement, sides move inwards until this share of their length
        is on the mask. None for no refinement.

    Returns
    -------
    (4, 2) float64 or None
        Corners in the mask's pixels; None if no component is larger than `MIN_AREA`. If the
        ellipse is degenerate, the corners of `rectangle_box`.
    """
    contour = _largest_contour(mask)
    if contour is None:
        return None
    center, axes, angle = cv2.fitEllipse(contour)
    if not np.isfinite([*center, *axes, angle]).all():
        return _rectangle(contour)
    level_from_mask = cv2.getRotationMatrix2D(center, angle, 1)
    ellipse = _mapped(level_from_mask, cv2.boxPoints((center, axes, angle)))
    sides = _sides(ellipse, _mapped(level_from_mask, contour[:, 0]), mask.shape)
    if factor is not None:
        sides = _refined(_level_mask(mask, level_from_mask), sides, factor)
    left, top, right, bottom = sides
    if right <= left or bottom <= top:
        return _rectangle(contour)
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    return _mapped(cv2.invertAffineTransform(level_from_mask), corners)


def _largest_contour(mask: Mask, min_area: float = MIN_AREA) -> NDArray[np.int32] | None:
    """Outline (n, 1, 2) of the largest component; None if it is too small."""
    contours = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[-2]
    areas = [cv2.contourArea(contour) for contour in contours]
    if not areas or max(areas) <= min_area:
        return None
    return np.asarray(contours[int(np.argmax(areas))], dtype=np.int32)


def _rectangle(contour: NDArray[np.int32]) -> Points:
    return np.asarray(cv2.boxPoints(cv2.minAreaRect(contour)), dtype=np.float64)


def _mapped(to_from_from: NDArray[np.generic], points: NDArray[np.generic]) -> Points:
    """Points (n, 2) mapped by a (2, 3) transform, float64."""
    matrix = np.asarray(to_from_from, dtype=np.float64)
    return np.asarray(points.astype(np.float64) @ matrix[:, :2].T + matrix[:, 2])


def _sides(ellipse: Points, contour: Points, shape: tuple[int, ...]) -> Sides:
    """Intersection of the leveled ellipse's box with the bounds of the contour inside of it."""
    low, high = ellipse.min(axis=0), ellipse.max(axis=0)
    whole = contour.astype(np.int32)
    x, y, w, h = cv2.boundingRect(whole[((whole >= low) & (whole <= high)).all(axis=1)])
    last_y, last_x = shape[0] - 1, shape[1] - 1
    return (
        min(max(x, low[0], 0.0), last_x),
        min(max(y, low[1], 0.0), last_y),
        max(min(x + w, high[0], last_x), 0.0),
        max(min(y + h, high[1], last_y), 0.0),
    )


def _level_mask(mask: Mask, level_from_mask: NDArray[np.generic]) -> NDArray[np.uint8]:
    """The mask (H, W) rotated so that the ellipse's axes are upright; 0 or 1."""
    size_wh = mask.shape[1], mask.shape[0]
    leveled = cv2.warpAffine(mask.astype(np.uint8), np.asarray(level_from_mask), size_wh)
    return np.asarray(leveled, dtype=np.uint8)


def _refined(level: NDArray[np.uint8], sides: Sides, factor: float) -> Sides:
    """Sides moved inwards, left and right first, until a share `factor` of each is on the mask."""
    left, top, right, bottom = sides
    columns = level[int(top) : int(bottom)].sum(axis=0)
    left, right = _tightened(columns, left, right, (bottom - top) * factor)
    rows = level[:, int(left) : int(right)].sum(axis=1)
    top, bottom = _tightened(rows, top, bottom, (right - left) * factor)
    return left, top, right, bottom


def _tightened(
    filled: NDArray[np.generic], low: float, high: float, min_filled: float
) -> tuple[float, float]:
    """Both ends moved toward each other until their lines have `min_filled` pixels on the mask.

    `filled` (n,) is the number of mask pixels in each line. The low end moves first.
    """
    while filled[int(low)] < min_filled:
        nearer = low + (high - low) * _STEP
        if nearer >= len(filled) - 1 or high - low < 1:
            break
        low = nearer
    while filled[int(high)] < min_filled:
        nearer = high - (high - low) * _STEP
        if nearer <= 0 or high - low < 1:
            break
        high = nearer
    return low, high
