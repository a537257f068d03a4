"""EfficientNet-Lite0 up to stride 16, its first five blocks as they were or lighter.

EfficientNet (Tan and Le, ICML 2019) without squeeze-and-excitation and with ReLU6, as its authors
trained it for phones. Names of the weights are those of the published checkpoint, and zeros are
added at the edges as TensorFlow's "same" does: where one column more is needed on one side than on
the other, on the right and at the bottom.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.errors import ArgumentError

__all__ = ["CHANNELS", "STEM_LEVELS", "EfficientNetLite0"]

CHANNELS: Final = (24, 40, 112)  # of the levels, strides 4, 8 and 16

STEM_LEVELS: Final = 2  # which a light stem gives

_MEAN, _DEVIATION = 127.0, 128.0  # of the pixels, as the weights were trained
_STEM: Final = 32  # channels
_LIGHT_STEM: Final = 16
_LIGHT_HIDDEN: Final = 32
_KEEPS_UP: Final = 0.1  # momentum of the statistics of what learns from nothing


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
    light : bool
        A `LightStem` makes the first two levels, in less than half of the time.
    """

    def __init__(self, blocks: int = _ALL, *, light: bool = False) -> None:
        if not _SHALLOWEST <= blocks <= _ALL:
            raise ArgumentError(f"blocks {blocks} of the backbone: give {_SHALLOWEST} to {_ALL}")
        super().__init__()
        self.stem = LightStem() if light else None
        if not light:
            self._conv_stem = nn.Conv2d(3, _STEM, 3, stride=2, bias=False)
            self._bn0 = _norm(_STEM)
        self._blocks = nn.ModuleDict()
        everything = [block for stage in _STAGES for block in stage][:blocks]
        before = (_STEM, *(block.channels for block in everything))
        for number in range(_STARTS[STEM_LEVELS] if light else 0, blocks):
            self._blocks[str(number)] = _InvertedResidual(before[number], everything[number])

    def forward(self, crop: Tensor) -> list[Tensor]:
        """The three levels of a crop."""
        return self.lower(crop, len(_STAGES))

    def lower(self, crop: Tensor, count: int) -> list[Tensor]:
        """The first `count` levels of a crop, 1 to 3."""
        pixels = (crop - _MEAN) / _DEVIATION
        if self.stem is not None:
            return self.completed(self.stem(pixels), count)[:count]
        features = F.relu6(_normalised(self._conv_stem, self._bn0, pixels))
        return self.completed([self._stage(0, features)], count)

    def completed(self, levels: list[Tensor], count: int = len(_STAGES)) -> list[Tensor]:
        """The first `count` levels, given the first of them: with a light stem two or three."""
        levels = list(levels)
        for number in range(len(levels), count):
            levels.append(self._stage(number, levels[-1]))
        return levels

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(_STAGES)

    def stage_weights(self, number: int) -> list[nn.Parameter]:
        """The parameters that lead from level `number` - 1 to level `number`, 1 or 2."""
        return [each for block in self._stage_blocks(number) for each in block.parameters()]

    def _stage(self, number: int, features: Tensor) -> Tensor:
        out: Tensor = features
        for block in self._stage_blocks(number):
            out = block(out)
        return out

    def _stage_blocks(self, number: int) -> list[nn.Module]:
        """Those that lead from level `number` - 1 to level `number`; a light stem has none."""
        start = _STARTS[number]
        names = map(str, range(start, start + len(_STAGES[number])))
        return [self._blocks[name] for name in names if name in self._blocks]


class LightStem(nn.Module):
    """Levels of strides 4 and 8 as those of the first five blocks, from fewer and thinner ones.

    The second convolution is not depthwise: at its size that is quicker than to widen, filter and
    narrow. Cells lie where those of `EfficientNetLite0` do.
    """

    def __init__(self) -> None:
        super().__init__()
        self._conv_stem = nn.Conv2d(3, _LIGHT_STEM, 3, stride=2, bias=False)
        self._bn0 = _norm(_LIGHT_STEM)
        self._conv_hidden = nn.Conv2d(_LIGHT_STEM, _LIGHT_HIDDEN, 3, stride=2, bias=False)
        self._bn1 = _norm(_LIGHT_HIDDEN)
        fine, coarse = CHANNELS[:STEM_LEVELS]
        self._project = nn.Sequential(nn.Conv2d(_LIGHT_HIDDEN, fine, 1, bias=False), _norm(fine))
        self._fine = _InvertedResidual(fine, _Block(fine, 3, expansion=2))
        self._coarse = nn.Sequential(
            _InvertedResidual(fine, _Block(coarse, 5, 2, expansion=4)),
            _InvertedResidual(coarse, _Block(coarse, 5, expansion=3)),
        )
        for module in self.modules():
            if isinstance(module, nn.BatchNorm2d):
                module.momentum = _KEEPS_UP

    def forward(self, pixels: Tensor) -> list[Tensor]:
        """Levels (N, 24, n, n) and (N, 40, m, m) of normalised pixels (N, 3, S, S)."""
        features = F.relu6(_normalised(self._conv_stem, self._bn0, pixels))
        hidden = F.relu6(_normalised(self._conv_hidden, self._bn1, features))
        fine = self._fine(self._project(hidden))
        return [fine, self._coarse(fine)]


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
            out = F.relu6(_normalised(self._expand_conv, self._bn0, out))
        out = F.relu6(_normalised(self._depthwise_conv, self._bn1, out))
        projected = _normalised(self._project_conv, self._bn2, out)
        return features + projected if self._residual else projected


def _normalised(convolution: nn.Conv2d, norm: nn.BatchNorm2d, features: Tensor) -> Tensor:
    """A convolution, normalised; one operation where the statistics stay.

    Gradients through the normalisations of their own took a third of a training step.
    """
    if norm.training:
        normalised: Tensor = norm(_same(features, convolution, convolution.weight))
        return normalised
    mean, variance = norm.running_mean, norm.running_var
    assert mean is not None
    assert variance is not None
    scale = norm.weight / torch.sqrt(variance + norm.eps)
    weight = convolution.weight * scale[:, None, None, None]
    return _same(features, convolution, weight, norm.bias - mean * scale)


def _same(
    features: Tensor, convolution: nn.Conv2d, weight: Tensor, bias: Tensor | None = None
) -> Tensor:
    """A convolution with TensorFlow's "same" padding: ceil(side / stride) cells come out."""
    stride, kernel = convolution.stride[0], convolution.kernel_size[0]
    side = int(features.shape[-1])
    total = max((-(-side // stride) - 1) * stride + kernel - side, 0)
    before, after = total // 2, total - total // 2
    if before != after:
        features = F.pad(features, (before, after, before, after))
        before = 0
    return F.conv2d(features, weight, bias, stride, before, groups=convolution.groups)


def _norm(channels: int) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01)
