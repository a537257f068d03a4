"""How much of a region agrees with the truth: by pixels, as the VOT toolkits count, and by area.

Regions are rows of 4 or 8 numbers, see `ssiam.evaluation.regions`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.evaluation.raster import Floats, count_pixels
from ssiam.evaluation.regions import (
    Bounds,
    Numbers,
    around,
    corners_of,
    is_box,
    is_flat,
    is_region,
    paired_rows,
    within,
)

# Ratio of two areas below which pysot calls the overlap 0 without looking.
_NEGLIGIBLE = 1e-10
# Pixels: a row above every window.
_ABOVE = -1e9


def vot_overlap(
    regions: ArrayLike, truth: ArrayLike, bounds: tuple[float, float] | None = None
) -> Floats:
    """Overlap (N,) of regions with the truth as pysot-toolkit counts it, 0 to 1.

    A region is rounded to whole pixels within the rectangle around both and drawn with its
    borders; a rectangle has its corners at x, x + w, y, y + h. Computed in float32, as there.

    Parameters
    ----------
    regions, truth : (N, 4) or (N, 8)
        Pixels.
    bounds : (width, height), optional
        What lies right of `width` or below `height` is not counted; pixels.

    Returns
    -------
    (N,) float64
        nan where one of the two is no region, or none of them covers a pixel.

    Raises
    ------
    ArgumentError
        The arrays do not belong together, or a region is larger than any picture and no bounds
        are given.
    """
    rows, other_rows = paired_rows(regions, truth)
    known = np.flatnonzero(is_region(rows) & is_region(other_rows))
    overlap = np.full(len(rows), np.nan)
    overlap[known] = _pysot(corners_of(rows[known]), corners_of(other_rows[known]), bounds)
    return overlap


def toolkit_overlap(regions: ArrayLike, truth: ArrayLike, bounds: tuple[int, int]) -> Floats:
    """Overlap (N,) of regions with the truth as vot-toolkit 0.7.4 counts it, 0 to 1.

    A polygon is drawn with its borders, (w + 1) by (h + 1) pixels, a rectangle as w by h:
    an exact rectangle has less than 1 against a polygon. Numbers are rounded, .5 to even. Where
    there is no region, it is an empty one at the origin: 0, or 1 if both are empty.

    `regions`, `truth`: (N, 4) or (N, 8), pixels. `bounds`: width and height of the frame.
    """
    rows, other_rows = (np.round(each.astype(np.float32)) for each in paired_rows(regions, truth))
    first, second = _toolkit_bounds(rows), _toolkit_bounds(other_rows)
    union = around(first, second)
    window = within(union, _limits(0, 0, bounds[0] - 1, bounds[1] - 1))
    overlap = np.zeros(len(rows))
    overlap[is_flat(union)] = 1
    drawn = np.flatnonzero(~is_flat(union) & ~is_flat(window))
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


def centre_distance(xywh: ArrayLike, other: ArrayLike, *, in_sizes: bool = False) -> Floats:
    """Distance (N,) of the centres of boxes (N, 4), pixels; nan where a box is not known.

    With `in_sizes` it is counted in widths and heights of the `other`, which must not be 0.
    """
    a, b = np.asarray(xywh, dtype=np.float64), np.asarray(other, dtype=np.float64)
    apart = (a[:, :2] + a[:, 2:] / 2) - (b[:, :2] + b[:, 2:] / 2)
    apart /= b[:, 2:] if in_sizes else 1
    return np.asarray(np.hypot(apart[:, 0], apart[:, 1]))


def _pysot(corners: Numbers, others: Numbers, bounds: tuple[float, float] | None) -> Floats:
    a, b = corners.astype(np.float32), others.astype(np.float32)
    limit = _limits(0, 0, *bounds) if bounds else _limits(-np.inf, -np.inf, np.inf, np.inf)
    box, other_box = (within(_whole_bounds(quads), limit) for quads in (a, b))
    window = around(box, other_box)
    width = np.trunc(window.right - window.left).astype(np.float64) + 1
    height = np.trunc(window.bottom - window.top).astype(np.float64) + 1
    drawn = np.flatnonzero(_may_meet(box, other_box) & (width >= 1) & (height >= 1))
    shift = np.stack([window.left, window.top], axis=-1)[drawn, None]
    quads, other_quads = (_rounded(each[drawn] - shift) for each in (a, b))
    shared, covered = count_pixels(quads, other_quads, width[drawn], height[drawn], closed=False)
    overlap = np.zeros(len(a))
    with np.errstate(invalid="ignore"):
        overlap[drawn] = shared.astype(np.float32) / covered.astype(np.float32)
    return overlap


def _may_meet(a: Bounds, b: Bounds) -> NDArray[np.bool_]:
    """Whether pysot draws two regions at all; nan of its fractions counts as yes."""
    area, other_area = (
        ((each.right - each.left) * (each.bottom - each.top)).astype(np.float64) for each in (a, b)
    )
    both = within(a, b)
    shared = (both.right - both.left) * (both.bottom - both.top)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio, other_ratio = area / other_area, other_area / area
        share = shared / (area.astype(np.float32) + other_area.astype(np.float32) - shared)
    never = (ratio < _NEGLIGIBLE) | (other_ratio < _NEGLIGIBLE) | (share <= 0)
    return np.asarray(~never, dtype=np.bool_)


def _limits(left: float, top: float, right: float, bottom: float) -> Bounds:
    """The same bounds for every frame."""
    return Bounds(*np.array([[left], [top], [right], [bottom]], dtype=np.float32))


def _rounded(values: Numbers) -> Floats:
    """Whole numbers, .5 away from zero."""
    return np.trunc(values + np.copysign(0.5, values).astype(np.float64))


def _whole_bounds(corners: Numbers) -> Bounds:
    low, high = np.floor(corners.min(axis=1)), np.ceil(corners.max(axis=1))
    return Bounds(low[:, 0], low[:, 1], high[:, 0], high[:, 1])


def _toolkit_bounds(rows: Numbers) -> Bounds:
    """Around each region: of a rectangle its first and last pixel, of no region the origin."""
    corners = corners_of(rows, extra=1)
    low, high = corners.min(axis=1), corners.max(axis=1)
    box = is_box(rows)
    low[box], high[box] = corners[box, 0], corners[box, 2]
    empty = ~is_region(rows)
    low[empty] = high[empty] = 0
    return Bounds(*low.T.astype(np.float64), *high.T.astype(np.float64))


def _toolkit_corners(rows: Numbers) -> Floats:
    """First and last pixels; of what covers none, corners above every row."""
    corners = corners_of(rows, extra=1).astype(np.float64)
    empty = ~is_region(rows) | (is_box(rows) & ~(rows[:, 2:4] >= 1).all(axis=1))
    corners[empty] = _ABOVE
    return corners
