"""Refinement of SiamMask: a mask of 127 x 127 from one cell of the correlation.

Its inputs are windows of the search features about that cell, which the tracker cuts.
"""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor, nn

__all__ = ["Refine"]


class Refine(nn.Module):
    """Mask logits of one cell, from coarse to fine (Wang et al., CVPR 2019)."""

    def __init__(self) -> None:
        super().__init__()
        self.v0 = _twice(64, 16, 4)
        self.v1 = _twice(256, 64, 16)
        self.v2 = _twice(512, 128, 32)
        self.h2 = _twice(32, 32, 32)
        self.h1 = _twice(16, 16, 16)
        self.h0 = _twice(4, 4, 4)
        self.deconv = nn.ConvTranspose2d(256, 32, 15, stride=15)
        self.post0 = nn.Conv2d(32, 16, 3, padding=1)
        self.post1 = nn.Conv2d(16, 4, 3, padding=1)
        self.post2 = nn.Conv2d(4, 1, 3, padding=1)

    def forward(self, x0: Tensor, p1: Tensor, p2: Tensor, corr: Tensor) -> Tensor:
        """Logits (1, 16129) of a mask of 127 x 127, row by row.

        Parameters
        ----------
        x0 : Tensor
            Window (1, 64, 61, 61) of the first convolution's features.
        p1, p2 : Tensor
            Windows (1, 256, 31, 31) and (1, 512, 15, 15) of layers 1 and 2.
        corr : Tensor
            The mask head's correlation at the cell, (1, 256, 1, 1).
        """
        out: Tensor = self.deconv(corr)  # (1, 32, 15, 15)
        out = self.post0(_enlarged(self.h2(out) + self.v2(p2), 31))
        out = self.post1(_enlarged(self.h1(out) + self.v1(p1), 61))
        out = self.post2(_enlarged(self.h0(out) + self.v0(x0), 127))
        return out.flatten(1)


def _twice(channels: int, hidden: int, out: int) -> nn.Sequential:
    return nn.Sequential(
        *[nn.Conv2d(channels, hidden, 3, padding=1), nn.ReLU(inplace=True)],
        *[nn.Conv2d(hidden, out, 3, padding=1), nn.ReLU(inplace=True)],
    )


def _enlarged(features: Tensor, side: int) -> Tensor:
    return F.interpolate(features, size=(side, side), mode="nearest")
