"""SiamMask: SiamRPN's scores and boxes, and a mask of the target (Wang et al., CVPR 2019)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.networks.backbones.resnet import ResNet50
from ssiam.networks.base import SiameseNetwork
from ssiam.networks.correlation import CorrelationHead
from ssiam.networks.neck import Neck
from ssiam.networks.rpn import RPN

__all__ = ["SiamMask", "SiamMaskBase"]

_MASK_SIDE: Final = 63  # px, of the masks before refinement


class SiamMaskBase(SiameseNetwork):
    """SiamMask without refinement: a mask of 63 x 63 px per cell.

    Crops are BGR in 0..255, float32, not normalized. `search` returns the mask head's correlation,
    not its masks: a tracker needs `masks` of one of the 625 cells only.
    """

    kernel_names = (*RPN.kernel_names, "mask_kernel")
    response_names: tuple[str, ...] = ("cls", "loc", "corr")

    def __init__(self) -> None:
        super().__init__()
        self.backbone = ResNet50((0, 1, 2, 3))
        self.neck = Neck(1024)
        self.rpn_head = RPN()
        self.mask_head = CorrelationHead(_MASK_SIDE * _MASK_SIDE)

    def template(self, crop: Tensor) -> tuple[Tensor, ...]:
        """Kernels (1, 256, 5, 5) for scores, boxes and masks of a crop (1, 3, 127, 127)."""
        templates = self.neck.template(self.backbone(crop))
        return (*self.rpn_head.kernels(templates), self.mask_head.kernel(templates[0]))

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> tuple[Tensor, ...]:
        """Raw scores (1, 10, 25, 25), boxes (1, 20, 25, 25) and correlation (1, 256, 25, 25)."""
        return self._responses(self.backbone(crop), kernels, sliced=sliced)

    def masks(self, corr: Tensor) -> Tensor:
        """Mask logits (1, 3969, n, n), 63 x 63 per cell, of a correlation (1, 256, n, n)."""
        return self.mask_head.maps(corr)

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, ...]:
        """Raw scores, boxes and the mask logits of all cells (1, 3969, 25, 25)."""
        cls, loc, corr = self.search(search, self.template(template))[:3]
        return cls, loc, self.masks(corr)

    def _responses(
        self, levels: Sequence[Tensor], kernels: Sequence[Tensor], *, sliced: bool
    ) -> tuple[Tensor, ...]:
        (features,) = self.neck.search(levels)
        *rpn_kernels, mask_kernel = kernels
        cls, loc = self.rpn_head([features], rpn_kernels, sliced=sliced)
        return cls, loc, self.mask_head.correlation(features, mask_kernel, sliced=sliced)


class SiamMask(SiamMaskBase):
    """SiamMask with refined masks of 127 x 127 px: pysot's siammask_r50_l3."""

    response_names = ("cls", "loc", "corr", "x0", "p1", "p2")

    def __init__(self) -> None:
        super().__init__()
        self.refine_head = Refine()

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> tuple[Tensor, ...]:
        """The output of `SiamMaskBase.search`, followed by the features for `Refine`.

        These are x0 (1, 64, 125, 125), p1 (1, 256, 63, 63) and p2 (1, 512, 31, 31).
        """
        levels = self.backbone(crop)
        return (*self._responses(levels, kernels, sliced=sliced), *levels[:3])


class Refine(nn.Module):
    """Refinement of the mask of one cell, from coarse to fine (Wang et al., CVPR 2019)."""

    def __init__(self) -> None:
        super().__init__()
        self.v0 = _two_convs(64, 16, 4)
        self.v1 = _two_convs(256, 64, 16)
        self.v2 = _two_convs(512, 128, 32)
        self.h2 = _two_convs(32, 32, 32)
        self.h1 = _two_convs(16, 16, 16)
        self.h0 = _two_convs(4, 4, 4)
        self.deconv = nn.ConvTranspose2d(256, 32, 15, stride=15)
        self.post0 = nn.Conv2d(32, 16, 3, padding=1)
        self.post1 = nn.Conv2d(16, 4, 3, padding=1)
        self.post2 = nn.Conv2d(4, 1, 3, padding=1)

    def forward(self, x0: Tensor, p1: Tensor, p2: Tensor, corr: Tensor) -> Tensor:
        """Logits (1, 16129) of a mask of 127 x 127, row by row.

        Parameters
        ----------
        x0 : Tensor
            Patch (1, 64, 61, 61) of the first convolution's features around the cell.
        p1, p2 : Tensor
            Patches (1, 256, 31, 31) and (1, 512, 15, 15) of the features of layers 1 and 2.
        corr : Tensor
            The mask head's correlation at the cell, (1, 256, 1, 1).
        """
        out: Tensor = self.deconv(corr)  # (1, 32, 15, 15)
        out = self.post0(_upsample(self.h2(out) + self.v2(p2), 31))
        out = self.post1(_upsample(self.h1(out) + self.v1(p1), 61))
        out = self.post2(_upsample(self.h0(out) + self.v0(x0), 127))
        return out.flatten(1)


def _two_convs(channels: int, hidden: int, out: int) -> nn.Sequential:
    return nn.Sequential(
        *[nn.Conv2d(channels, hidden, 3, padding=1), nn.ReLU(inplace=True)],
        *[nn.Conv2d(hidden, out, 3, padding=1), nn.ReLU(inplace=True)],
    )


def _upsample(features: Tensor, side: int) -> Tensor:
    return F.interpolate(features, size=(side, side), mode="nearest")
