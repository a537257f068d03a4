"""SiamMask: SiamRPN's scores and boxes, and a mask of the target (Wang et al., CVPR 2019)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from torch import Tensor

from ssiam.networks.correlation import CorrelationHead
from ssiam.networks.mask import Refine
from ssiam.networks.neck import Neck
from ssiam.networks.resnet import ResNet50
from ssiam.networks.rpn import RPN
from ssiam.networks.siamese import SiameseNetwork

__all__ = ["SiamMask", "SiamMaskBase"]

_MASK_SIDE: Final = 63  # px, of the mask head's own masks


class SiamMaskBase(SiameseNetwork):
    """SiamMask whose masks are the mask head's own, 63 x 63 pixels a cell.

    Crops are BGR in 0..255, float32, not normalised. The search piece stops at the mask head's
    correlation: `masks` of the one cell that a tracker wants costs a 625th of all of them.
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
        """Mask logits (1, 3969, n, n) of a correlation (1, 256, n, n): 63 x 63 a cell, by rows."""
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
    """SiamMask with refined masks of 127 x 127 pixels: pysot's siammask_r50_l3."""

    response_names = ("cls", "loc", "corr", "x0", "p1", "p2")

    def __init__(self) -> None:
        super().__init__()
        self.refine_head = Refine()

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> tuple[Tensor, ...]:
        """What `SiamMaskBase.search` returns, and the features from which masks are refined.

        Those are x0 (1, 64, 125, 125), p1 (1, 256, 63, 63) and p2 (1, 512, 31, 31).
        """
        levels = self.backbone(crop)
        return (*self._responses(levels, kernels, sliced=sliced), *levels[:3])
