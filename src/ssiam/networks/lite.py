"""The small tracker's own network: one light backbone, correlation, and maps without anchors.

Parts of the template are compared with every place of the search crop (pixel-wise correlation,
Liao et al., PG-Net, ECCV 2020). From that, and from what the place itself looks like, each cell
tells whether it lies on the target, how far the target's sides are away, and how well the box so
made will fit (FCOS, Tian et al., ICCV 2019; Varifocal and IoU-aware scores after it).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.networks.efficientnet_lite import CHANNELS, EfficientNetLite0
from ssiam.networks.siamese import SiameseNetwork

__all__ = ["BLOCKS", "CELLS", "MASK_CELLS", "STRIDE", "LiteNetwork", "LiteResponses"]

BLOCKS: Final = 9  # of the backbone
STRIDE: Final = 8  # px of the search crop between cells
CELLS: Final = 32  # a side, of the response maps
MASK_CELLS: Final = 64  # a side, of the mask; 4 px each

_WIDTH: Final = 96  # channels of the features that are compared
_MASK_WIDTHS: Final = (32, 24, 16)  # channels at stride 8, where stride 4 is added, and after that
_KERNEL_SIDE: Final = 8  # cells: the middle 64 px of the template crop, which the target fills
_RARE: Final = 0.01  # share of cells on the target, from which the scores start
_START: Final = 32.0  # px, distances at first: half of a target in the crops
_LAYOUT: Final = torch.channels_last  # in which convolutions learn fastest
_GREATEST: Final = 4.0  # natural logarithm of the greatest distance, in strides


class LiteResponses(NamedTuple):
    """What the network tells of a search crop.

    Attributes
    ----------
    score : (N, 1, 32, 32)
        Logits: the cell lies on the target.
    quality : (N, 1, 32, 32)
        Logits of the overlap (IoU) of the cell's box with the target.
    distances : (N, 4, 32, 32)
        From the cell's middle to the left, top, right and bottom of the target, px of the crop.
    mask : (N, 1, 64, 64)
        Logits: the 4 x 4 px lie on the target.
    """

    score: Tensor
    quality: Tensor
    distances: Tensor
    mask: Tensor


class LiteNetwork(SiameseNetwork):
    """Scores, box distances, their quality and a mask.

    Crops are BGR in 0..255, float32. The middle of cell (row, column) lies at ((column - 15.5) * 8,
    (row - 15.5) * 8) px from the search crop's middle pixel.

    Parameters
    ----------
    blocks : int
        Of the backbone, 9 to 11: the last two take a fifth of the time of a search.
    light : bool
        Whether the backbone begins with a `LightStem`.
    """

    kernel_names = ("kernel",)
    response_names = LiteResponses._fields

    def __init__(self, blocks: int = BLOCKS, *, light: bool = True) -> None:
        super().__init__()
        self.backbone = EfficientNetLite0(blocks, light=light)
        self.neck = _Neck()
        self.compare = _normed(nn.Conv2d(_KERNEL_SIDE**2 + _WIDTH, _WIDTH, 1, bias=False))
        self.join = _Separable(_WIDTH)
        self.score_tower = nn.Sequential(_Separable(_WIDTH), _Separable(_WIDTH))
        self.box_tower = nn.Sequential(_Separable(_WIDTH), _Separable(_WIDTH))
        self.score = nn.Conv2d(_WIDTH, 1, 1)
        self.quality = nn.Conv2d(_WIDTH, 1, 1)
        self.distances = nn.Conv2d(_WIDTH, 4, 1)
        self.mask_head = _MaskHead()
        self._start()

    def template(self, crop: Tensor) -> tuple[Tensor, ...]:
        """Kernel (N, 64, 96) of a template crop (N, 3, 127, 127), alone in a tuple."""
        return (self.kernel(self.backbone(crop)),)

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> LiteResponses:
        """Responses of a search crop (N, 3, 255, 255); `sliced` makes no difference."""
        return self.responses(self.backbone(crop), kernels[0])

    def kernel(self, levels: Sequence[Tensor]) -> Tensor:
        """Kernel (N, 64, 96) of a template crop's levels: 64 parts, each of length 1."""
        features = self.neck(levels)
        start = (int(features.shape[-1]) - _KERNEL_SIDE) // 2
        middle = slice(start, start + _KERNEL_SIDE)
        parts = features[:, :, middle, middle].flatten(2).transpose(1, 2)
        return F.normalize(parts, dim=2)

    def responses(self, levels: Sequence[Tensor], kernel: Tensor) -> LiteResponses:
        """Responses of a search crop's levels to a kernel."""
        features = self.neck(levels)
        alike = torch.matmul(kernel, features.flatten(2))
        alike = alike.reshape(-1, _KERNEL_SIDE**2, *features.shape[2:])
        together = torch.cat([alike, features], dim=1).contiguous(memory_format=_LAYOUT)
        response = self.join(self.compare(together))
        boxes = self.box_tower(response)
        strides = torch.exp(self.distances(boxes).clamp(max=_GREATEST))
        return LiteResponses(
            score=self.score(self.score_tower(response)),
            quality=self.quality(boxes),
            distances=strides * STRIDE,
            mask=self.mask_head((response, boxes, features), levels[0]),
        )

    def _start(self) -> None:
        """Biases from which the first steps of training do not have to fetch the outputs."""
        for head, value in (
            (self.score, -math.log(1 / _RARE - 1)),
            (self.quality, 0.0),
            (self.distances, math.log(_START / STRIDE)),
        ):
            nn.init.normal_(head.weight, std=0.01)
            nn.init.constant_(head.bias, value)  # type: ignore[arg-type]


class _Neck(nn.Module):
    """Levels of strides 8 and 16 -> features (N, 96, n, n) of stride 8."""

    def __init__(self) -> None:
        super().__init__()
        self.fine = _projected(CHANNELS[1], _WIDTH)
        self.coarse = _projected(CHANNELS[2], _WIDTH)

    def forward(self, levels: Sequence[Tensor]) -> Tensor:
        fine: Tensor = self.fine(levels[1])
        return fine + _doubled(self.coarse(levels[2]))


class _MaskHead(nn.Module):
    """From what is known at stride 8, and the edges of stride 4, logits (N, 1, 64, 64).

    The response tells where the target is, the box tower how far it reaches, and the features
    what belongs together.
    """

    def __init__(self) -> None:
        super().__init__()
        known, joint, last = _MASK_WIDTHS
        self.known = nn.ModuleList(_projected(_WIDTH, known) for _ in range(3))
        self.coarse = _convolved(known, joint)
        self.fine = _projected(CHANNELS[0], joint)
        self.join = nn.Sequential(_convolved(joint, last), _convolved(last, last))
        self.logits = nn.Conv2d(last, 1, 1)

    def forward(self, stride8: Sequence[Tensor], stride4: Tensor) -> Tensor:
        together = [project(maps) for project, maps in zip(self.known, stride8, strict=True)]
        coarse = self.coarse(F.relu(together[0] + together[1] + together[2]))
        logits: Tensor = self.logits(self.join(F.relu(_doubled(coarse) + self.fine(stride4))))
        return logits


class _Separable(nn.Sequential):
    """Depthwise 5 x 5 and pointwise convolution, each normalised and rectified."""

    def __init__(self, channels: int) -> None:
        depthwise = nn.Conv2d(channels, channels, 5, padding=2, groups=channels, bias=False)
        pointwise = nn.Conv2d(channels, channels, 1, bias=False)
        super().__init__(_normed(depthwise), _normed(pointwise))


def _convolved(channels: int, out: int) -> nn.Sequential:
    """A 3 x 3 convolution, not depthwise: at these sizes that is as quick, and learns faster."""
    return _normed(nn.Conv2d(channels, out, 3, padding=1, bias=False))


def _normed(convolution: nn.Conv2d) -> nn.Sequential:
    norm = nn.BatchNorm2d(convolution.out_channels)
    return nn.Sequential(convolution, norm, nn.ReLU(inplace=True))


def _projected(channels: int, out: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels, out, 1, bias=False), nn.BatchNorm2d(out))


def _doubled(features: Tensor) -> Tensor:
    return F.interpolate(features, scale_factor=2.0, mode="nearest")
