"""Overlap of regions with the ground truth as the VOT toolkits count it, and center distance.

Regions are rows of 4 or 8 numbers; see `ssiam.evaluation.measures.regions`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.evaluation.measures.raster import count_pixels
from ssiam.evaluation.measures.regions import (
    Bounds,
    Floats,
    Numbers,
    corners_of,
    intersection,
    is_box,
    is_empty,
    is_region,
    paired_rows,
    union_bounds,
)

# Ratio of two areas below which pysot takes the overlap as 0.
_NEGLIGIBLE = 1e-10
# Pixels: a row above every window.
_ABOVE = -1e9


def vot_overlap(
    regions: ArrayLike, truth: ArrayLike, bounds: tuple[float, float] | None = None
) -> Floats:
    """Overlap (N,) of regions with the ground truth as pysot-toolkit counts it, 0 to 1.

    Each region is rounded to whole pixels within the bounding rectangle of both and drawn with its
    borders; a rectangle has its corners at x, x + w, y, y + h. Computed in float32, as in pysot.

    Parameters
    ----------
    regions, truth : (N, 4) or (N, 8)
        Pixels.
    bounds : (width, height), optional
        Nothing right of `width` or below `height` is counted; pixels.

    Returns
    -------
    (N,) float64
        nan where one of the two is not a region, or neither covers a pixel.

    Raises
    ------
    ArgumentError
        The arrays have different numbers of frames or wrong shapes, or a region is larger than
        any image and no bounds are given.
    """
    rows, other_rows = paired_rows(regions, truth)
    known = np.flatnonzero(is_region(rows) & is_region(other_rows))
    overlap = np.full(len(rows), np.nan)
    overlap[known] = _pysot_overlap(corners_of(rows[known]), corners_of(other_rows[known]), bounds)
    return overlap


def toolkit_overlap(regions: ArrayLike, truth: ArrayLike, bounds: tuple[int, int]) -> Floats:
    """Overlap (N,) of regions with the ground truth as vot-toolkit 0.7.4 counts it, 0 to 1.

    A polygon is drawn with its borders, (w + 1) by (h + 1) pixels, a rectangle as w by h: an exact
    rectangle has an overlap below 1 with the same polygon. Numbers are rounded, .5 to even.

    Parameters
    ----------
    regions, truth : (N, 4) or (N, 8)
        Pixels.
    bounds : (width, height)
        Size of the frame, pixels.

    Returns
    -------
    (N,) float64
        A missing region counts as an empty one at the origin: 0, or 1 if both are missing.

    Raises
    ------
    ArgumentError
        The arrays have different numbers of frames or wrong shapes.
    """
    rows, other_rows = (np.round(each.astype(np.float32)) for each in paired_rows(regions, truth))
    first, second = _toolkit_bounds(rows), _toolkit_bounds(other_rows)
    union = union_bounds(first, second)
    window = intersection(union, _limits(0, 0, bounds[0] - 1, bounds[1] - 1))
    overlap = np.zeros(len(rows))
    overlap[is_empty(union)] = 1
    drawn = np.flatnonzero(~is_empty(union) & ~is_empty(window))
    shift = np.stack([window.left, window.top], axis=-1)[drawn, None]
    shared, covered = count_pixels(
        _toolkit_corners(rows[drawn]) - shift,
        _toolkit_corners(other_rows[drawn]) - shift,
        (window.right - window.left + 1)[drawn],
        (window.bottom - window.top + 1)[drawn],
        closed=True,
    )
    overlap[drawn] = shared / np.maximum(covered, 1)
    return overlap


def center_distance(xywh: ArrayLike, other: ArrayLike, *, in_sizes: bool = False) -> Floats:
    """Distance (N,) between the centers of boxes (N, 4), pixels; nan where a box is nan.

    With `in_sizes` the offset is divided by the width and height of `other`, which must not be 0.
    """
    a, b = np.asarray(xywh, dtype=np.float64), np.asarray(other, dtype=np.float64)
    offset = (a[:, :2] + a[:, 2:] / 2) - (b[:, :2] + b[:, 2:] / 2)
    offset /= b[:, 2:] if in_sizes else 1
    return np.asarray(np.hypot(offset[:, 0], offset[:, 1]))


def _pysot_overlap(corners: Numbers, others: Numbers, bounds: tuple[float, float] | None) -> Floats:
    """Overlap (N,) of quadrilaterals (N, 4, 2), with the steps and rounding of pysot-toolkit."""
    a, b = corners.astype(np.float32), others.astype(np.float32)
    limit = _limits(0, 0, *bounds) if bounds else _limits(-np.inf, -np.inf, np.inf, np.inf)
    box, other_box = (intersection(_whole_bounds(quads), limit) for quads in (a, b))
    window = union_bounds(box, other_box)
    width = np.trunc(window.right - window.left).astype(np.float64) + 1
    height = np.trunc(window.bottom - window.top).astype(np.float64) + 1
    drawn = np.flatnonzero(_may_overlap(box, other_box) & (width >= 1) & (height >= 1))
    shift = np.stack([window.left, window.top], axis=-1)[drawn, None]
    quads, other_quads = (_rounded(each[drawn] - shift) for each in (a, b))
    shared, covered = count_pixels(quads, other_quads, width[drawn], height[drawn], closed=False)
    overlap = np.zeros(len(a))
    with np.errstate(invalid="ignore"):
        overlap[drawn] = shared.astype(np.float32) / covered.astype(np.float32)
    return overlap


def _may_overlap(a: Bounds, b: Bounds) -> NDArray[np.bool_]:
    """Whether pysot draws the two regions (N,) bool; a nan ratio counts as yes."""
    area, other_area = (
        ((each.right - each.left) * (each.bottom - each.top)).astype(np.float64) for each in (a, b)
    )
    both = intersection(a, b)
    shared = (both.right - both.left) * (both.bottom - both.top)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio, other_ratio = area / other_area, other_area / area
        share = shared / (area.astype(np.float32) + other_area.astype(np.float32) - shared)
    never = (ratio < _NEGLIGIBLE) | (other_ratio < _NEGLIGIBLE) | (share <= 0)
    return np.asarray(~never, dtype=np.bool_)


def _limits(left: float, top: float, right: float, bottom: float) -> Bounds:
    """One rectangle for all frames."""
    return Bounds(*np.array([[left], [top], [right], [bottom]], dtype=np.float32))


def _rounded(values: Numbers) -> Floats:
    """Rounded to whole numbers, .5 away from zero."""
    return np.trunc(values + np.copysign(0.5, values).astype(np.float64))


def _whole_bounds(corners: Numbers) -> Bounds:
    low, high = np.floor(corners.min(axis=1)), np.ceil(corners.max(axis=1))
    return Bounds(low[:, 0], low[:, 1], high[:, 0], high[:, 1])


def _toolkit_bounds(rows: Numbers) -> Bounds:
    """Bounds of each region; first and last pixel of a rectangle, the origin if missing."""
    corners = corners_of(rows, extra=1)
    low, high = corners.min(axis=1), corners.max(axis=1)
    box = is_box(rows)
    low[box], high[box] = corners[box, 0], corners[box, 2]
    empty = ~is_region(rows)
    low[empty] = high[empty] = 0
    return Bounds(*low.T.astype(np.float64), *high.T.astype(np.float64))


def _toolkit_corners(rows: Numbers) -> Floats:
    """Corners at first and last pixels; above every row for a region that covers no pixel."""
    corners = corners_of(rows, extra=1).astype(np.float64)
    empty = ~is_region(rows) | (is_box(rows) & ~(rows[:, 2:4] >= 1).all(axis=1))
    corners[empty] = _ABOVE
    return corners
