"""Windows of SiamMask's search features about a cell of the correlation.

Arrays only, so that whatever ran the network, its features can be cut.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Windows", "cut_windows"]


class _Cut(NamedTuple):
    stride: int  # cells of the features by cells of the correlation
    side: int
    padding: int


_X0: Final = _Cut(4, 61, 16)
_P1: Final = _Cut(2, 31, 8)
_P2: Final = _Cut(1, 15, 4)
_CORR: Final = _Cut(1, 1, 0)


class Windows(NamedTuple):
    """What the refinement takes for one cell, float32.

    `x0` (1, 64, 61, 61), `p1` (1, 256, 31, 31), `p2` (1, 512, 15, 15), `corr` (1, 256, 1, 1).
    """

    x0: NDArray[np.float32]
    p1: NDArray[np.float32]
    p2: NDArray[np.float32]
    corr: NDArray[np.float32]


def cut_windows(
    corr: NDArray[np.float32],
    x0: NDArray[np.float32],
    p1: NDArray[np.float32],
    p2: NDArray[np.float32],
    *,
    row: int,
    column: int,
) -> Windows:
    """Windows about the cell (`row`, `column`) of the correlation, 0 outside of the features.

    Parameters
    ----------
    corr, x0, p1, p2 : array
        (1, 256, 25, 25), (1, 64, 125, 125), (1, 256, 63, 63) and (1, 512, 31, 31), float32, as
        the search piece returns them.
    row, column : int
        0 to 24.
    """
    return Windows(
        _window(x0, row, column, _X0),
        _window(p1, row, column, _P1),
        _window(p2, row, column, _P2),
        _window(corr, row, column, _CORR),
    )


def _window(features: NDArray[np.float32], row: int, column: int, cut: _Cut) -> NDArray[np.float32]:
    window = np.zeros((*features.shape[:2], cut.side, cut.side), np.float32)
    to_rows, from_rows = _overlap(row, features.shape[2], cut)
    to_columns, from_columns = _overlap(column, features.shape[3], cut)
    window[:, :, to_rows, to_columns] = features[:, :, from_rows, from_columns]
    return window


def _overlap(cell: int, length: int, cut: _Cut) -> tuple[slice, slice]:
    """Where the window and the features meet: in the window, and in the features."""
    start = cell * cut.stride - cut.padding
    first, last = max(start, 0), min(start + cut.side, length)
    return slice(first - start, last - start), slice(first, last)
