"""A network for the mask of the object in a box, run only when a mask is requested.

The box is enlarged and stretched to a square crop, so that a narrow target has the same resolution
as a round one, and the crop alone defines the target (as in AlphaRefine, Yan et al., CVPR 2021).
A feature pyramid upsamples EfficientNet-Lite0's features to stride 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.networks.backbones.efficientnet_lite import CHANNELS, EfficientNetLite0

__all__ = ["BOX_MASK_CELLS", "BOX_MASK_CONTEXT", "BOX_MASK_CROP", "BoxMaskNetwork"]

BOX_MASK_CROP: Final = 128  # px, side of the crop
BOX_MASK_CELLS: Final = 64  # per side of the mask; a cell is 2 px wide
BOX_MASK_CONTEXT: Final = 1.6  # width and height of the crop, in those of the box

_WIDTHS: Final = (16, 32, 64, 64)  # channels at strides 2, 4, 8, 16


class BoxMaskNetwork(nn.Module):
    """Crop (N, 3, 128, 128) -> logits (N, 1, 64, 64): the cell of 2 x 2 px is on the target.

    Crops are BGR in 0..255, float32: the box, enlarged by `BOX_MASK_CONTEXT` and stretched.
    """

    input_names: tuple[str, ...] = ("mask_crop",)
    output_names: tuple[str, ...] = ("mask_logits",)

    def __init__(self) -> None:
        super().__init__()
        self.backbone = EfficientNetLite0()
        self.edges = _conv_norm_relu(3, _WIDTHS[0], stride=2)
        self.lateral = nn.ModuleList(
            _conv_norm(channels, width)
            for channels, width in zip(CHANNELS, _WIDTHS[1:], strict=True)
        )
        self.joined = nn.ModuleList(
            [
                _conv_norm_relu(_WIDTHS[2], _WIDTHS[1]),
                _conv_norm_relu(_WIDTHS[1], _WIDTHS[0]),
                _conv_norm_relu(_WIDTHS[0], _WIDTHS[0]),
            ]
        )
        self.context = _conv_norm_relu(_WIDTHS[3], _WIDTHS[3])
        self.logits = nn.Conv2d(_WIDTHS[0], 1, 1)

    def forward(self, crop: Tensor) -> Tensor:
        """Mask logits (N, 1, 64, 64) of crops."""
        return self._decode(crop, self.backbone(crop))

    def _decode(self, crop: Tensor, levels: Sequence[Tensor]) -> Tensor:
        """Mask logits of crops and their features at strides 4, 8 and 16."""
        at4, at8, at16 = (
            project(level) for project, level in zip(self.lateral, levels, strict=True)
        )
        conv8, conv4, conv2 = self.joined  # at strides 8, 4 and 2
        features = F.relu(at8 + _upsample(self.context(F.relu(at16))))
        features = F.relu(at4 + _upsample(conv8(features)))
        features = self.edges(crop / 128 - 1) + _upsample(conv4(features))
        logits: Tensor = self.logits(conv2(features))
        return logits


def _conv_norm_relu(channels: int, out: int, stride: int = 1) -> nn.Sequential:
    convolution = nn.Conv2d(channels, out, 3, stride=stride, padding=1, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(out), nn.ReLU(inplace=True))


def _conv_norm(channels: int, out: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels, out, 1, bias=False), nn.BatchNorm2d(out))


def _upsample(features: Tensor) -> Tensor:
    return F.interpolate(features, scale_factor=2.0, mode="nearest")
