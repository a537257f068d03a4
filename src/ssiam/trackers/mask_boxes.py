"""Rotated boxes of masks: SiamMask's smallest rectangle, and SiamMask_E's box by an ellipse.

SiamMask_E is Chen and Tsotsos, "Fast Visual Object Tracking using Ellipse Fitting for Rotated
Bounding Boxes" (arXiv 1907.03892); the steps below are those of its Fig. 3, in its authors' order.
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

SMALLEST_AREA: Final = 100.0  # px^2; a contour with less is noise
_STEP: Final = 0.02  # of the box's width or height, by which a side moves inwards


def rectangle_box(mask: Mask, smallest_area: float = SMALLEST_AREA) -> Points | None:
    """Smallest rotated rectangle around the mask's largest piece.

    Parameters
    ----------
    mask : (H, W) bool
    smallest_area : float
        Pixels that a piece has to cover more than; the references' 100 unless given.

    Returns
    -------
    (4, 2) float64 or None
        Corners in the mask's pixels; None if no piece covers more than that.
    """
    contour = _largest_contour(mask, smallest_area)
    return None if contour is None else _rectangle(contour)


def ellipse_box(mask: Mask, factor: float | None = None) -> Points | None:
    """SiamMask_E's rotated box: the ellipse gives its angle, ellipse and contour its sides.

    Parameters
    ----------
    mask : (H, W) bool
    factor : float, optional
        The refinement's alpha: sides move inwards until this share of their line lies on the
        mask; None leaves the refinement out.

    Returns
    -------
    (4, 2) float64 or None
        Corners in the mask's pixels; None if no piece covers more than 100 pixels. Where the
        ellipse is degenerate, the corners of `rectangle_box`.
    """
    contour = _largest_contour(mask)
    if contour is None:
        return None
    centre, axes, angle = cv2.fitEllipse(contour)
    if not np.isfinite([*centre, *axes, angle]).all():
        return _rectangle(contour)
    level_from_mask = cv2.getRotationMatrix2D(centre, angle, 1)
    ellipse = _turned(level_from_mask, cv2.boxPoints((centre, axes, angle)))
    sides = _sides(ellipse, _turned(level_from_mask, contour[:, 0]), mask.shape)
    if factor is not None:
        sides = _refined(_level_mask(mask, level_from_mask), sides, factor)
    left, top, right, bottom = sides
    if right <= left or bottom <= top:
        return _rectangle(contour)
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    return _turned(cv2.invertAffineTransform(level_from_mask), corners)


def _largest_contour(mask: Mask, smallest_area: float = SMALLEST_AREA) -> NDArray[np.int32] | None:
    """Outline (n, 1, 2) of the largest piece, None if it is too small."""
    contours = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[-2]
    areas = [cv2.contourArea(contour) for contour in contours]
    if not areas or max(areas) <= smallest_area:
        return None
    return np.asarray(contours[int(np.argmax(areas))], dtype=np.int32)


def _rectangle(contour: NDArray[np.int32]) -> Points:
    return np.asarray(cv2.boxPoints(cv2.minAreaRect(contour)), dtype=np.float64)


def _turned(to_from_from: NDArray[np.generic], points: NDArray[np.generic]) -> Points:
    """Points (n, 2) through a (2, 3) transform, float64."""
    matrix = np.asarray(to_from_from, dtype=np.float64)
    return np.asarray(points.astype(np.float64) @ matrix[:, :2].T + matrix[:, 2])


def _sides(ellipse: Points, contour: Points, shape: tuple[int, ...]) -> Sides:
    """The box that the level ellipse's box and the part of the contour in it share."""
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
    """The mask (H, W) turned until the ellipse is upright; 0 or 1."""
    size_wh = mask.shape[1], mask.shape[0]
    turned = cv2.warpAffine(mask.astype(np.uint8), np.asarray(level_from_mask), size_wh)
    return np.asarray(turned, dtype=np.uint8)


def _refined(level: NDArray[np.uint8], sides: Sides, factor: float) -> Sides:
    """Sides moved inwards, left and right first, to lines of which `factor` lies on the mask."""
    left, top, right, bottom = sides
    columns = level[int(top) : int(bottom)].sum(axis=0)
    left, right = _tightened(columns, left, right, (bottom - top) * factor)
    rows = level[:, int(left) : int(right)].sum(axis=1)
    top, bottom = _tightened(rows, top, bottom, (right - left) * factor)
    return left, top, right, bottom


def _tightened(
    filled: NDArray[np.generic], low: float, high: float, wanted: float
) -> tuple[float, float]:
    """Both ends moved towards each other until the mask fills `wanted` pixels of their line.

    `filled` (n,): the mask's pixels in each line. The low end moves first.
    """
    while filled[int(low)] < wanted:
        nearer = low + (high - low) * _STEP
        if nearer >= len(filled) - 1 or high - low < 1:
            break
        low = nearer
    while filled[int(high)] < wanted:
        nearer = high - (high - low) * _STEP
        if nearer <= 0 or high - low < 1:
            break
        high = nearer
    return low, high
