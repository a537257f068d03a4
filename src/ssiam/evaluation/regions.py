"""Rows of numbers as regions: their corners and the rectangles around them.

A region is a row of 4 numbers (x, y, w, h) or of 8 (the corners x1, y1, ... x4, y4), pixels. In an
array of 8 columns a row whose last four are nan is a rectangle; a row of nan is no region.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.errors import ArgumentError
from ssiam.evaluation.raster import Floats
from ssiam.geometry import area_preserving_xywh

# Pixels: farther than any picture, and what float32 still tells in steps of 8.
_FAR = 1e8

Numbers: TypeAlias = NDArray[np.floating[Any]]


class Bounds(NamedTuple):
    """Left, top, right, bottom; each (N,)."""

    left: Numbers
    top: Numbers
    right: Numbers
    bottom: Numbers


def as_rows(regions: ArrayLike) -> Floats:
    """Regions (N, 4) or (N, 8) as (N, 8), the last four of a rectangle nan.

    Numbers that no picture reaches are brought nearer, for float32 has no room for them.

    Raises
    ------
    ArgumentError
        The array has another shape.
    """
    rows = np.asarray(regions, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] not in (4, 8):
        raise ArgumentError(
            f"regions of the shape {rows.shape}: give (frames, 4) or (frames, 8) numbers"
        )
    padded = np.pad(rows, ((0, 0), (0, 8 - rows.shape[1])), constant_values=np.nan)
    return np.clip(padded, -_FAR, _FAR)


def paired_rows(regions: ArrayLike, truth: ArrayLike) -> tuple[Floats, Floats]:
    """Both `as_rows`; `ArgumentError` if one has more frames."""
    rows, other_rows = as_rows(regions), as_rows(truth)
    if len(rows) != len(other_rows):
        raise ArgumentError(f"{len(rows)} regions for a truth of {len(other_rows)} frames")
    return rows, other_rows


def is_region(rows: Numbers) -> NDArray[np.bool_]:
    """Rows (N, 4) or (N, 8) that hold a region at all: (N,) bool."""
    known = np.isfinite(rows)
    whole = known[:, 4:].all(axis=1) | np.isnan(rows[:, 4:]).all(axis=1)
    return np.asarray(known[:, :4].all(axis=1) & whole, dtype=np.bool_)


def is_box(rows: Numbers) -> NDArray[np.bool_]:
    """Rows (N, 8) whose last four are nan, rectangles and no regions: (N,) bool."""
    return np.asarray(np.isnan(rows[:, 4:]).all(axis=1), dtype=np.bool_)


def corners_of(rows: Numbers, extra: float = 0) -> Numbers:
    """Corners (N, 4, 2); those of a rectangle lie at x and x + w - `extra`, y likewise."""
    corners = rows.reshape(-1, 4, 2).copy()
    box = is_box(rows)
    x, y, w, h = rows[box, :4].T
    right, bottom = x + w - extra, y + h - extra
    corners[box] = np.stack([x, y, right, y, right, bottom, x, bottom], axis=-1).reshape(-1, 4, 2)
    return corners


def around(a: Bounds, b: Bounds) -> Bounds:
    """The smallest bounds that hold both."""
    low = (np.minimum(x, y) for x, y in zip(a[:2], b[:2], strict=True))
    return Bounds(*low, *(np.maximum(x, y) for x, y in zip(a[2:], b[2:], strict=True)))


def within(a: Bounds, b: Bounds) -> Bounds:
    """What lies in both; left > right or top > bottom where nothing does."""
    low = (np.maximum(x, y) for x, y in zip(a[:2], b[:2], strict=True))
    return Bounds(*low, *(np.minimum(x, y) for x, y in zip(a[2:], b[2:], strict=True)))


def is_flat(bounds: Bounds) -> NDArray[np.bool_]:
    """Where nothing lies between left and right, or between top and bottom: (N,) bool."""
    return (bounds.left >= bounds.right) | (bounds.top >= bounds.bottom)


def upright(regions: Floats) -> Floats:
    """Regions (N, 4) or (N, 8) as boxes (N, 4): of a polygon, the one of its centre and area."""
    boxes = regions[:, :4].copy()
    if regions.shape[1] == 8:
        for row in np.flatnonzero(np.isfinite(regions).all(axis=1)):
            boxes[row] = area_preserving_xywh(regions[row].reshape(4, 2))
    return boxes
