"""Pixel counts of the intersection and union of quadrilaterals, for many frames at once.

The VOT toolkits compare regions as sets of pixels. A row of pixels crosses the edges of a
quadrilateral at most four times, so at most two runs of the row are covered. Counting the lengths
of the runs gives the same numbers as drawing masks, without drawing any.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.regions import Floats

# Rows of one frame: the height limit of common image formats.
_MAX_ROWS = 65_536
# Rows counted at once: their arrays fit a processor's cache.
_BATCH_ROWS = 16_384
# Pixels: a column beyond every corner.
_NOWHERE = 1e10


class _Runs(NamedTuple):
    """Covered pixels of each row: two runs [start, stop), the second right of the first."""

    start: Floats
    stop: Floats
    second_start: Floats
    second_stop: Floats


def count_pixels(
    corners: Floats, others: Floats, width: Floats, height: Floats, *, closed: bool
) -> tuple[Floats, Floats]:
    """Pixels (N,) covered by both quadrilaterals, and pixels (N,) covered by either.

    Parameters
    ----------
    corners, others : (N, 4, 2) float64
        Corners in a window whose top left pixel is (0, 0); whole numbers, pixels.
    width, height : (N,) float64
        Size of each window, pixels; nothing outside of it is counted.
    closed : bool
        Whether horizontal edges and runs of a single pixel count as covered (vot-toolkit), or only
        the pixels between two different crossings (pysot).

    Raises
    ------
    ArgumentError
        A window has more rows than an image can have.
    """
    if len(height) and height.max() > _MAX_ROWS:
        raise ArgumentError(
            f"a region spans {height.max():.0f} rows of pixels; give bounds of at most {_MAX_ROWS}"
        )
    shared, covered = np.zeros(len(corners)), np.zeros(len(corners))
    for batch in _batches(height):
        rows = np.arange(height[batch].max())[None]
        size = width[batch, None], height[batch, None]
        runs, other_runs = (_runs(quads[batch], rows, *size, closed) for quads in (corners, others))
        shared[batch] = _shared(runs, other_runs)
        covered[batch] = _area(runs) + _area(other_runs) - shared[batch]
    return shared, covered


def _batches(height: Floats) -> Iterator[NDArray[np.intp]]:
    """Indices of windows of similar height, so that few rows are counted needlessly."""
    order = np.argsort(height)[::-1]
    first = 0
    while first < len(order) and height[order[first]] > 0:
        count = max(1, int(_BATCH_ROWS / height[order[first]]))
        yield order[first : first + count]
        first += count


def _runs(corners: Floats, rows: Floats, width: Floats, height: Floats, closed: bool) -> _Runs:
    """The runs (N, rows) of each row, clipped to the window."""
    a, b, c, d = _sorted_nodes(corners, rows, height, closed)
    crossed = b > a
    end = np.where(crossed, b, np.where(c > a, c, d))
    if closed:
        end = np.where(end == _NOWHERE, a, end)
        twice = crossed & (d < _NOWHERE)
    else:
        end = np.where((end == _NOWHERE) | (end == a), -1, end)
        twice = crossed & (d < _NOWHERE) & (d > c)
    start, stop = np.clip(a, 0, width), np.clip(end + 1, 0, width)
    stop = np.maximum(start, stop)
    second_start = np.maximum(np.clip(np.where(twice, c, _NOWHERE), 0, width), stop)
    second_stop = np.maximum(np.clip(d + 1, 0, width), second_start)
    return _Runs(start, stop, second_start, second_stop)


def _sorted_nodes(corners: Floats, rows: Floats, height: Floats, closed: bool) -> list[Floats]:
    """Columns, in order, at which the edges cross each row; `_NOWHERE` for edges that do not."""
    a, b, c, d = (
        _nodes(corners[:, i, :, None], corners[:, i - 1, :, None], rows, height, closed)
        for i in range(4)
    )
    a, b = np.minimum(a, b), np.maximum(a, b)
    c, d = np.minimum(c, d), np.maximum(c, d)
    a, c = np.minimum(a, c), np.maximum(a, c)
    b, d = np.minimum(b, d), np.maximum(b, d)
    return [a, np.minimum(b, c), np.maximum(b, c), d]


def _nodes(corner: Floats, previous: Floats, rows: Floats, height: Floats, closed: bool) -> Floats:
    """Column at which the edge between two corners (N, 2, 1) crosses each row."""
    (x, y), (dx, dy) = corner.transpose(1, 0, 2), (previous - corner).transpose(1, 0, 2)
    top, bottom = np.minimum(y, y + dy), np.minimum(np.maximum(y, y + dy), height - 1)
    flat = dy == 0
    if not closed:
        bottom = np.where(flat, -1, bottom)
    columns = np.trunc(x + (rows - y) / np.where(flat, 1, dy) * np.where(flat, 0, dx))
    return np.where((rows >= top) & (rows <= bottom), columns, _NOWHERE)


def _area(runs: _Runs) -> Floats:
    return np.asarray(
        (runs.stop - runs.start + runs.second_stop - runs.second_start).sum(axis=1),
    )


def _shared(runs: _Runs, others: _Runs) -> Floats:
    total = np.zeros(len(runs.start))
    for start, stop in (runs[:2], runs[2:]):
        for other_start, other_stop in (others[:2], others[2:]):
            both = np.minimum(stop, other_stop) - np.maximum(start, other_start)
            total += np.maximum(both, 0).sum(axis=1)
    return total
