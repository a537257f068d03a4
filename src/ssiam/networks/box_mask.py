"""The mask of whatever fills a box: a network of its own, run only where somebody asks for a mask.

The box is grown and stretched to a square crop, so that a slim target is seen as finely as a round
one, and the network needs no other hint of which object is meant (as the refinement of AlphaRefine,
Yan et al., CVPR 2021). EfficientNet-Lite0's ImageNet features are brought up to stride 2 by a
feature pyramid.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.networks.efficientnet_lite import CHANNELS, EfficientNetLite0

__all__ = ["BOX_MASK_CELLS", "BOX_MASK_CONTEXT", "BOX_MASK_CROP", "BoxMaskNetwork"]

BOX_MASK_CROP: Final = 128  # px, side of the crop
BOX_MASK_CELLS: Final = 64  # a side of the mask; 2 px each
BOX_MASK_CONTEXT: Final = 1.6  # times the box's width and height that the crop shows

_BLOCKS: Final = 9  # of the backbone
_WIDTHS: Final = (16, 32, 64, 64)  # channels at strides 2, 4, 8, 16


class BoxMaskNetwork(nn.Module):
    """Crop (N, 3, 128, 128) -> logits (N, 1, 64, 64) of 2 x 2 px lying on the target.

    Crops are BGR in 0..255, float32: the box, 1.6 times as wide and as high, stretched.
    """

    input_names: tuple[str, ...] = ("mask_crop",)
    output_names: tuple[str, ...] = ("mask_logits",)

    def __init__(self) -> None:
        super().__init__()
        self.backbone = EfficientNetLite0(_BLOCKS, light=False)
        self.edges = _convolved(3, _WIDTHS[0], stride=2)
        self.lateral = nn.ModuleList(
            _projected(channels, width)
            for channels, width in zip(CHANNELS, _WIDTHS[1:], strict=True)
        )
        self.joined = nn.ModuleList(
            [
                _convolved(_WIDTHS[2], _WIDTHS[1]),
                _convolved(_WIDTHS[1], _WIDTHS[0]),
                _convolved(_WIDTHS[0], _WIDTHS[0]),
            ]
        )
        self.context = _convolved(_WIDTHS[3], _WIDTHS[3])
        self.logits = nn.Conv2d(_WIDTHS[0], 1, 1)

    def forward(self, crop: Tensor) -> Tensor:
        """Mask logits of crops."""
        return self.decoded(crop, self.backbone(crop))

    def decoded(self, crop: Tensor, levels: Sequence[Tensor]) -> Tensor:
        """Mask logits of crops and their features at strides 4, 8 and 16."""
        at4, at8, at16 = (
            project(level) for project, level in zip(self.lateral, levels, strict=True)
        )
        from16, from8, from4 = self.joined
        features = F.relu(at8 + _doubled(self.context(F.relu(at16))))
        features = F.relu(at4 + _doubled(from16(features)))
        features = self.edges(crop / 128 - 1) + _doubled(from8(features))
        logits: Tensor = self.logits(from4(features))
        return logits


def _convolved(channels: int, out: int, stride: int = 1) -> nn.Sequential:
    convolution = nn.Conv2d(channels, out, 3, stride=stride, padding=1, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(out), nn.ReLU(inplace=True))


def _projected(channels: int, out: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels, out, 1, bias=False), nn.BatchNorm2d(out))


def _doubled(features: Tensor) -> Tensor:
    return F.interpolate(features, scale_factor=2.0, mode="nearest")
