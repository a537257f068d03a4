"""The network of `lite`: a light backbone, pixel-wise correlation and an anchor-free head.

Every cell of the template is correlated with every cell of the search crop (Liao et al., PG-Net,
ECCV 2020). From the correlations and its own features, each cell predicts whether it is on the
target, the distances to the target's sides, and the overlap of that box with the target (FCOS, Tian
et al., ICCV 2019, with the IoU-aware score of VarifocalNet, Zhang et al., CVPR 2021).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.networks.backbones.efficientnet_lite import CHANNELS, EfficientNetLite0
from ssiam.networks.base import SiameseNetwork

__all__ = ["BLOCKS", "CELLS", "MASK_CELLS", "STRIDE", "LiteNetwork", "LiteResponses"]

BLOCKS: Final = 9  # blocks of the backbone, by default
STRIDE: Final = 8  # px of the search crop between cells
CELLS: Final = 32  # per side of the response maps
MASK_CELLS: Final = 64  # per side of the mask; a cell is 4 px wide

_WIDTH: Final = 96  # channels of the correlated features
_MASK_WIDTHS: Final = (32, 24, 16)  # channels at stride 8, at the sum with stride 4, after it
_KERNEL_SIDE: Final = 8  # cells: the central 64 px of the template crop, filled by the target
_INITIAL_SCORE: Final = 0.01  # probability; about the share of cells on the target
_INITIAL_DISTANCE: Final = 32.0  # px, half of the target's nominal size in crops
_LAYOUT: Final = torch.channels_last  # in which training is fastest
_MAX_LOG_DISTANCE: Final = 4.0  # natural logarithm of the largest distance, in strides


class LiteResponses(NamedTuple):
    """Response maps of a search crop.

    Attributes
    ----------
    score : (N, 1, 32, 32)
        Logits: the cell is on the target.
    quality : (N, 1, 32, 32)
        Logits of the overlap (IoU) of the cell's box with the target.
    distances : (N, 4, 32, 32)
        From the cell's center to the left, top, right and bottom of the target, px of the crop.
    mask : (N, 1, 64, 64)
        Logits: the cell of 4 x 4 px is on the target.
    """

    score: Tensor
    quality: Tensor
    distances: Tensor
    mask: Tensor


class LiteNetwork(SiameseNetwork):
    """Score, box distances, box quality and mask.

    Crops are BGR in 0..255, float32. The center of cell (row, column) is at ((column - 15.5) * 8,
    (row - 15.5) * 8) px from the center of the search crop.

    Parameters
    ----------
    blocks : int
        Blocks of the backbone, 9 to 11. The last two take a fifth of the time of a search.
    light : bool
        Use the backbone's light stem.
    """

    kernel_names = ("kernel",)
    response_names = LiteResponses._fields

    def __init__(self, blocks: int = BLOCKS, *, light: bool = True) -> None:
        super().__init__()
        self.backbone = EfficientNetLite0(blocks, light=light)
        self.neck = _Neck()
        self.compare = _norm_relu(nn.Conv2d(_KERNEL_SIDE**2 + _WIDTH, _WIDTH, 1, bias=False))
        self.join = _Separable(_WIDTH)
        self.score_tower = nn.Sequential(_Separable(_WIDTH), _Separable(_WIDTH))
        self.box_tower = nn.Sequential(_Separable(_WIDTH), _Separable(_WIDTH))
        self.score = nn.Conv2d(_WIDTH, 1, 1)
        self.quality = nn.Conv2d(_WIDTH, 1, 1)
        self.distances = nn.Conv2d(_WIDTH, 4, 1)
        self.mask_head = _MaskHead()
        self._init_heads()

    def template(self, crop: Tensor) -> tuple[Tensor, ...]:
        """Kernel (N, 64, 96) of a template crop (N, 3, 127, 127), as a 1-tuple."""
        return (self.kernel(self.backbone(crop)),)

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> LiteResponses:
        """Responses of a search crop (N, 3, 255, 255); `sliced` has no effect."""
        return self.responses(self.backbone(crop), kernels[0])

    def kernel(self, levels: Sequence[Tensor]) -> Tensor:
        """Kernel (N, 64, 96) of a template crop's levels: the unit features of 64 cells."""
        features = self.neck(levels)
        start = (int(features.shape[-1]) - _KERNEL_SIDE) // 2
        center = slice(start, start + _KERNEL_SIDE)
        cells = features[:, :, center, center].flatten(2).transpose(1, 2)
        return F.normalize(cells, dim=2)

    def responses(self, levels: Sequence[Tensor], kernel: Tensor) -> LiteResponses:
        """Responses of a search crop's levels to a kernel (N, 64, 96)."""
        features = self.neck(levels)
        correlation = torch.matmul(kernel, features.flatten(2))
        correlation = correlation.reshape(-1, _KERNEL_SIDE**2, *features.shape[2:])
        joint = torch.cat([correlation, features], dim=1).contiguous(memory_format=_LAYOUT)
        response = self.join(self.compare(joint))
        boxes = self.box_tower(response)
        strides = torch.exp(self.distances(boxes).clamp(max=_MAX_LOG_DISTANCE))
        return LiteResponses(
            score=self.score(self.score_tower(response)),
            quality=self.quality(boxes),
            distances=strides * STRIDE,
            mask=self.mask_head((response, boxes, features), levels[0]),
        )

    def _init_heads(self) -> None:
        """Initialize the biases to typical outputs, so that training starts faster."""
        for head, value in (
            (self.score, -math.log(1 / _INITIAL_SCORE - 1)),
            (self.quality, 0.0),
            (self.distances, math.log(_INITIAL_DISTANCE / STRIDE)),
        ):
            nn.init.normal_(head.weight, std=0.01)
            nn.init.constant_(head.bias, value)  # type: ignore[arg-type]


class _Neck(nn.Module):
    """Levels of strides 8 and 16 -> features (N, 96, n, n) of stride 8."""

    def __init__(self) -> None:
        super().__init__()
        self.fine = _conv_norm(CHANNELS[1], _WIDTH)
        self.coarse = _conv_norm(CHANNELS[2], _WIDTH)

    def forward(self, levels: Sequence[Tensor]) -> Tensor:
        fine: Tensor = self.fine(levels[1])
        return fine + _upsample(self.coarse(levels[2]))


class _MaskHead(nn.Module):
    """Three maps at stride 8 and features at stride 4 -> mask logits (N, 1, 64, 64).

    The maps at stride 8 are the response (where the target is), the box tower (how far it extends)
    and the features (which cells belong together). Stride 4 adds the edges.
    """

    def __init__(self) -> None:
        super().__init__()
        coarse, joint, last = _MASK_WIDTHS
        self.known = nn.ModuleList(_conv_norm(_WIDTH, coarse) for _ in range(3))
        self.coarse = _conv3(coarse, joint)
        self.fine = _conv_norm(CHANNELS[0], joint)
        self.join = nn.Sequential(_conv3(joint, last), _conv3(last, last))
        self.logits = nn.Conv2d(last, 1, 1)

    def forward(self, stride8: Sequence[Tensor], stride4: Tensor) -> Tensor:
        parts = [project(maps) for project, maps in zip(self.known, stride8, strict=True)]
        coarse = self.coarse(F.relu(parts[0] + parts[1] + parts[2]))
        logits: Tensor = self.logits(self.join(F.relu(_upsample(coarse) + self.fine(stride4))))
        return logits


class _Separable(nn.Sequential):
    """Depthwise 5 x 5 and pointwise convolution, each with batch normalization and ReLU."""

    def __init__(self, channels: int) -> None:
        depthwise = nn.Conv2d(channels, channels, 5, padding=2, groups=channels, bias=False)
        pointwise = nn.Conv2d(channels, channels, 1, bias=False)
        super().__init__(_norm_relu(depthwise), _norm_relu(pointwise))


def _conv3(channels: int, out: int) -> nn.Sequential:
    """A full 3 x 3 convolution; at these sizes as fast as a separable one, and trained faster."""
    return _norm_relu(nn.Conv2d(channels, out, 3, padding=1, bias=False))


def _norm_relu(convolution: nn.Conv2d) -> nn.Sequential:
    norm = nn.BatchNorm2d(convolution.out_channels)
    return nn.Sequential(convolution, norm, nn.ReLU(inplace=True))


def _conv_norm(channels: int, out: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels, out, 1, bias=False), nn.BatchNorm2d(out))


def _upsample(features: Tensor) -> Tensor:
    return F.interpolate(features, scale_factor=2.0, mode="nearest")
