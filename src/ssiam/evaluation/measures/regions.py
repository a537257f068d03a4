"""Regions as rows of numbers: validity, corners, bounds and upright boxes.

A region is a row of 4 numbers (x, y, w, h) or of 8 (the corners x1, y1, ... x4, y4), pixels. In an
array of 8 columns a row whose last four are nan is a rectangle, and a row of nan is a missing
region.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import area_preserving_xywh

# Pixels: farther than the border of any image, and still resolved by float32 in steps of 8.
_FAR = 1e8

Floats: TypeAlias = NDArray[np.float64]
Numbers: TypeAlias = NDArray[np.floating[Any]]


class Bounds(NamedTuple):
    """Left, top, right and bottom of N rectangles, each (N,), pixels."""

    left: Numbers
    top: Numbers
    right: Numbers
    bottom: Numbers


def as_rows(regions: ArrayLike) -> Floats:
    """Regions (N, 4) or (N, 8) as (N, 8) float64; the last four numbers of a rectangle are nan.

    Numbers far outside of any image are clipped, so that they fit float32.

    Raises
    ------
    ArgumentError
        The array has a different shape.
    """
    rows = np.asarray(regions, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] not in (4, 8):
        raise ArgumentError(
            f"regions of shape {rows.shape}: give an array (frames, 4) or (frames, 8)"
        )
    padded = np.pad(rows, ((0, 0), (0, 8 - rows.shape[1])), constant_values=np.nan)
    return np.clip(padded, -_FAR, _FAR)


def paired_rows(regions: ArrayLike, truth: ArrayLike) -> tuple[Floats, Floats]:
    """Both arrays as `as_rows`; `ArgumentError` if their numbers of frames differ."""
    rows, other_rows = as_rows(regions), as_rows(truth)
    if len(rows) != len(other_rows):
        raise ArgumentError(f"{len(rows)} regions for {len(other_rows)} frames of ground truth")
    return rows, other_rows


def is_region(rows: Numbers) -> NDArray[np.bool_]:
    """Whether each row (N, 4) or (N, 8) is a region, not a missing one: (N,) bool."""
    known = np.isfinite(rows)
    whole = known[:, 4:].all(axis=1) | np.isnan(rows[:, 4:]).all(axis=1)
    return np.asarray(known[:, :4].all(axis=1) & whole, dtype=np.bool_)


def is_box(rows: Numbers) -> NDArray[np.bool_]:
    """Whether the last four numbers of each row (N, 8) are nan: a rectangle or missing."""
    return np.asarray(np.isnan(rows[:, 4:]).all(axis=1), dtype=np.bool_)


def corners_of(rows: Numbers, extra: float = 0) -> Numbers:
    """Corners (N, 4, 2) of rows (N, 8); a rectangle spans x to x + w - `extra`, and y likewise."""
    corners = rows.reshape(-1, 4, 2).copy()
    box = is_box(rows)
    x, y, w, h = rows[box, :4].T
    right, bottom = x + w - extra, y + h - extra
    corners[box] = np.stack([x, y, right, y, right, bottom, x, bottom], axis=-1).reshape(-1, 4, 2)
    return corners


def union_bounds(a: Bounds, b: Bounds) -> Bounds:
    """The smallest bounds that contain both."""
    low = (np.minimum(x, y) for x, y in zip(a[:2], b[:2], strict=True))
    return Bounds(*low, *(np.maximum(x, y) for x, y in zip(a[2:], b[2:], strict=True)))


def intersection(a: Bounds, b: Bounds) -> Bounds:
    """The bounds common to both; left > right or top > bottom where they are disjoint."""
    low = (np.maximum(x, y) for x, y in zip(a[:2], b[:2], strict=True))
    return Bounds(*low, *(np.minimum(x, y) for x, y in zip(a[2:], b[2:], strict=True)))


def is_empty(bounds: Bounds) -> NDArray[np.bool_]:
    """Whether each rectangle has no width or no height: (N,) bool."""
    return (bounds.left >= bounds.right) | (bounds.top >= bounds.bottom)


def upright(regions: Floats) -> Floats:
    """Regions (N, 4) or (N, 8) as boxes (N, 4); polygons keep their center and area."""
    boxes = regions[:, :4].copy()
    if regions.shape[1] == 8:
        for row in np.flatnonzero(np.isfinite(regions).all(axis=1)):
            boxes[row] = area_preserving_xywh(regions[row].reshape(4, 2))
    return boxes
