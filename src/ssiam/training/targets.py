"""What each cell of the response maps should say, for pairs whose target is known."""

from __future__ import annotations

from typing import Final, NamedTuple

import torch
from torch import Tensor

from ssiam.networks.lite import CELLS, STRIDE

__all__ = ["Targets", "cell_targets", "corners_of", "decoded"]

_INNER: Final = 0.5  # half axes of the positive ellipse, by those of the box
_OUTER: Final = 1.0  # of the ellipse outside of which cells are negative


class Targets(NamedTuple):
    """Cells of N pairs.

    Attributes
    ----------
    positive : (N, n, n) bool
        On the target: the score is to be high, and the box counts.
    ignored : (N, n, n) bool
        Neither on the target nor off it.
    """

    positive: Tensor
    ignored: Tensor


def cell_targets(box: Tensor, present: Tensor, cells: int = CELLS, stride: int = STRIDE) -> Targets:
    """Which cells are on the target, and which on its rim.

    Positive are the cells in the ellipse of half the box's axes, and the one nearest to its
    centre, so that no target in the crop is without any; ignored are the others in the ellipse
    that touches the box's sides (SiamBAN, Chen et al., CVPR 2020, section 3.3); all others are
    negative, and so are all cells where the target is not present.

    Parameters
    ----------
    box : (N, 4) float32
        cx, cy, w, h in px of the search crop, from its middle pixel.
    present : (N,) bool
    cells, stride : int
        Side of the response maps, and px of the search crop between their cells.
    """
    at = _middles(box.device, cells, stride)
    cx, cy, w, h = box[:, :, None].unbind(1)  # (N, 1) each
    across = ((at - cx) / (w / 2).clamp(min=1e-3)) ** 2  # (N, n)
    down = ((at - cy) / (h / 2).clamp(min=1e-3)) ** 2
    radius = down[:, :, None] + across[:, None, :]  # squared, 1 on the ellipse of the box
    there = present & (box[:, :2].abs() < cells * stride / 2).all(dim=1)
    nearest = _nearest(at, cy)[:, :, None] & _nearest(at, cx)[:, None, :]
    positive = ((radius < _INNER**2) & present[:, None, None]) | (nearest & there[:, None, None])
    ignored = (radius < _OUTER**2) & present[:, None, None] & ~positive
    return Targets(positive, ignored)


def decoded(distances: Tensor, stride: int = STRIDE) -> Tensor:
    """Boxes (N, 4, n, n) left, top, right, bottom, px of the crop from its middle pixel.

    `distances` (N, 4, n, n) are those of the responses, `stride` px lie between their cells.
    """
    cells = int(distances.shape[-1])
    at = _middles(distances.device, cells, stride)
    x, y = at[None, :].expand(cells, cells), at[:, None].expand(cells, cells)
    left, top, right, bottom = distances.unbind(1)
    return torch.stack([x - left, y - top, x + right, y + bottom], dim=1)


def corners_of(box: Tensor) -> Tensor:
    """Left, top, right, bottom (N, 4) of boxes cx, cy, w, h (N, 4)."""
    centre, half = box[:, :2], box[:, 2:] / 2
    return torch.cat([centre - half, centre + half], dim=1)


def _middles(device: torch.device, cells: int, stride: int) -> Tensor:
    """Centers (n,) of the cells along an axis, px from the middle pixel."""
    return (torch.arange(cells, device=device) - (cells - 1) / 2) * stride


def _nearest(at: Tensor, centre: Tensor) -> Tensor:
    """Which cell (N, n) along an axis is nearest to the centers (N, 1)."""
    index = (at - centre).abs().argmin(dim=1)
    return torch.nn.functional.one_hot(index, len(at)).bool()
