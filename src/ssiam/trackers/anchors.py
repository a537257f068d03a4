"""Anchor boxes of SiamRPN and SiamMask, and the boxes decoded from them.

SiamRPN (Li et al., CVPR 2018, section 3.3) predicts four numbers for each anchor. The anchors'
shapes and their rounding are those of pysot.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ssiam.runtime import Tensor
from ssiam.trackers.siamese import TEMPLATE_SIDE, Floats

STRIDE: Final = 8  # px of the search region between cells of the response map
ANCHORS: Final = 5  # per cell
_RATIOS: Final = (0.33, 0.5, 1, 2, 3)  # height over width
_SCALE: Final = 8  # ANCHOR.SCALES of pysot


def response_side(instance: int, base: int) -> int:
    """Cells along the side of a response map.

    Parameters
    ----------
    instance : int
        Side of the search crop, pixels (INSTANCE_SIZE of pysot).
    base : int
        Number of cells that the network's padding adds (BASE_SIZE of pysot).
    """
    return (instance - TEMPLATE_SIDE) // STRIDE + 1 + base


def anchor_boxes(side: int) -> Floats:
    """All anchors of a response map of side * side cells.

    Returns
    -------
    (4, 5 * side * side) float64
        cx, cy, w, h in search-region pixels from the region's center, in the order shape, row,
        column.
    """
    offsets = (np.arange(side) - side // 2) * float(STRIDE)
    x, y = (np.tile(grid.ravel(), ANCHORS) for grid in np.meshgrid(offsets, offsets))
    w, h = np.repeat(np.array(_shapes(), dtype=np.float64), side * side, axis=0).T
    return np.stack([x, y, w, h])


def decode(loc: Tensor, anchors: Floats) -> Floats:
    """Boxes of a network's regression maps (eq. 12 of SiamRPN, inverted).

    Parameters
    ----------
    loc : (1, 20, n, n) float32
        dx, dy, dw, dh of each anchor and cell.
    anchors : (4, 5 * n * n) float64
        As returned by `anchor_boxes`.

    Returns
    -------
    (4, 5 * n * n) float64
        cx, cy, w, h in the same pixels as the anchors, computed in single precision as in pysot.
    """
    dx, dy, dw, dh = loc[0].reshape(4, -1)
    x, y, w, h = anchors.astype(np.float32)
    boxes = np.stack([dx * w + x, dy * h + y, np.exp(dw) * w, np.exp(dh) * h])
    return boxes.astype(np.float64)


def cell_of(index: int, side: int) -> tuple[int, int]:
    """Row and column of the cell of candidate `index`, in a response map of side * side cells."""
    row, column = divmod(index % (side * side), side)
    return row, column


def _shapes() -> list[tuple[int, int]]:
    """Width and height of the five anchors, with the truncations to whole numbers of pysot."""
    shapes = []
    for ratio in _RATIOS:
        w = int(np.sqrt(STRIDE * STRIDE / ratio))
        shapes.append((w * _SCALE, int(w * ratio) * _SCALE))
    return shapes
