"""What SiamMask's refinement network looks at: windows of its features around one cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ssiam.runtime import Tensor

# Of x0, p1 and p2: zeros added on each side, features between cells, side of the window.
_WINDOWS: Final = ((16, 4, 61), (8, 2, 31), (4, 1, 15))


def refinement_windows(
    corr: Tensor, features: Sequence[Tensor], cell: tuple[int, int]
) -> list[Tensor]:
    """Inputs of the refinement for one cell (row, column) of the response map.

    Parameters
    ----------
    corr : (1, 256, 25, 25) float32
        Correlation of template and search region.
    features : (1, 64, 125, 125), (1, 256, 63, 63) and (1, 512, 31, 31) float32
        The backbone's x0, p1 and p2 of the search region.
    cell : (int, int)

    Returns
    -------
    (1, 64, 61, 61), (1, 256, 31, 31), (1, 512, 15, 15) and (1, 256, 1, 1) float32
        Windows of x0, p1 and p2, zero outside of the region, and the cell's correlation.
    """
    row, column = cell
    windows = [
        _window(each, row * step - pad, column * step - pad, side)
        for each, (pad, step, side) in zip(features, _WINDOWS, strict=True)
    ]
    return [*windows, np.ascontiguousarray(corr[:, :, row : row + 1, column : column + 1])]


def _window(features: Tensor, top: int, left: int, side: int) -> Tensor:
    """Square of `side` from (top, left), which may lie outside: zeros there."""
    height, width = features.shape[2:]
    window = np.zeros((*features.shape[:2], side, side), np.float32)
    upper, lower = max(top, 0), min(top + side, height)
    near, far = max(left, 0), min(left + side, width)
    inside = features[:, :, upper:lower, near:far]
    window[:, :, upper - top : lower - top, near - left : far - left] = inside
    return window
