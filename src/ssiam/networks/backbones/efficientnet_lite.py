"""EfficientNet-Lite0 up to stride 16, with the published or a lighter stem.

EfficientNet (Tan and Le, ICML 2019) without squeeze-and-excitation and with ReLU6, the variant that
its authors published for phones. Parameter names are those of the published checkpoint. Padding is
TensorFlow's "same": if the total is odd, the extra row is at the bottom and the extra column on the
right.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.errors import ArgumentError

__all__ = ["CHANNELS", "STEM_LEVELS", "EfficientNetLite0"]

CHANNELS: Final = (24, 40, 112)  # of the levels: strides 4, 8 and 16
STEM_LEVELS: Final = 2  # number of levels that a light stem computes

_MEAN, _DEVIATION = 127.0, 128.0  # pixel normalization of the published weights
_STEM: Final = 32  # channels
_LIGHT_STEM: Final = 16
_LIGHT_HIDDEN: Final = 32
_LIGHT_MOMENTUM: Final = 0.1  # of the light stem's batch norms: it is trained from scratch


class _Block(NamedTuple):
    channels: int  # of the output
    side: int  # of the depthwise kernel
    stride: int = 1
    expansion: int = 6


_STAGES: Final = (  # each ends with a level
    (_Block(16, 3, expansion=1), _Block(24, 3, 2), _Block(24, 3)),
    (_Block(40, 5, 2), _Block(40, 5)),
    (*[_Block(80, 3, 2), _Block(80, 3), _Block(80, 3)], *[_Block(112, 5)] * 3),
)
_STARTS: Final = tuple(accumulate(map(len, _STAGES[:-1]), initial=0))  # first block of each stage
_MAX_BLOCKS: Final = sum(map(len, _STAGES))
_MIN_BLOCKS: Final = _MAX_BLOCKS - 2  # the last two are residual


class EfficientNetLite0(nn.Module):
    """Features of strides 4, 8 and 16: 64, 32 and 16 cells per side for a crop of 255 px.

    Crops are (N, 3, S, S) float32 BGR in 0..255; the levels have `CHANNELS` channels. If S + 1 is a
    multiple of 16, the receptive field of cell i is centered on pixel 4 i + 2, 8 i + 6 and
    16 i + 14 at strides 4, 8 and 16.

    Parameters
    ----------
    blocks : int
        Number of blocks, 9 to 11. The last two are residual, so they can be left out.
    light : bool
        Compute the first two levels with a `LightStem`, in less than half of the time.

    Raises
    ------
    ArgumentError
        `blocks` is out of range.
    """

    def __init__(self, blocks: int = _MAX_BLOCKS, *, light: bool = False) -> None:
        if not _MIN_BLOCKS <= blocks <= _MAX_BLOCKS:
            raise ArgumentError(
                f"blocks {blocks} of the backbone: give {_MIN_BLOCKS} to {_MAX_BLOCKS}"
            )
        super().__init__()
        self.stem = LightStem() if light else None
        if not light:
            self._conv_stem = nn.Conv2d(3, _STEM, 3, stride=2, bias=False)
            self._bn0 = _norm(_STEM)
        self._blocks = nn.ModuleDict()
        specs = [block for stage in _STAGES for block in stage][:blocks]
        inputs = (_STEM, *(block.channels for block in specs))
        for number in range(_STARTS[STEM_LEVELS] if light else 0, blocks):
            self._blocks[str(number)] = _InvertedResidual(inputs[number], specs[number])

    def forward(self, crop: Tensor) -> list[Tensor]:
        """Levels (N, 24, n, n), (N, 40, m, m) and (N, 112, k, k) of a crop (N, 3, S, S)."""
        return self.lower(crop, len(_STAGES))

    def lower(self, crop: Tensor, count: int) -> list[Tensor]:
        """The first `count` levels of a crop, 1 to 3."""
        pixels = (crop - _MEAN) / _DEVIATION
        if self.stem is not None:
            return self.complete(self.stem(pixels), count)[:count]
        features = F.relu6(_conv_norm(self._conv_stem, self._bn0, pixels))
        return self.complete([self._stage(0, features)], count)

    def complete(self, levels: list[Tensor], count: int = len(_STAGES)) -> list[Tensor]:
        """The first `count` levels, computed from the lower ones given in `levels`.

        With a light stem, `levels` must have at least two.
        """
        levels = list(levels)
        for number in range(len(levels), count):
            levels.append(self._stage(number, levels[-1]))
        return levels

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(_STAGES)

    def stage_parameters(self, number: int) -> list[nn.Parameter]:
        """Parameters between level `number` - 1 and level `number`, which is 1 or 2."""
        return [each for block in self._stage_blocks(number) for each in block.parameters()]

    def _stage(self, number: int, features: Tensor) -> Tensor:
        out: Tensor = features
        for block in self._stage_blocks(number):
            out = block(out)
        return out

    def _stage_blocks(self, number: int) -> list[nn.Module]:
        """Blocks between level `number` - 1 and level `number`, without those of a light stem."""
        start = _STARTS[number]
        names = map(str, range(start, start + len(_STAGES[number])))
        return [self._blocks[name] for name in names if name in self._blocks]


class LightStem(nn.Module):
    """The levels at strides 4 and 8, from fewer and thinner blocks than the published first five.

    The second convolution is a full one: at its size it is faster than an inverted residual. The
    centers of the receptive fields are those in `EfficientNetLite0`.
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
                module.momentum = _LIGHT_MOMENTUM

    def forward(self, pixels: Tensor) -> list[Tensor]:
        """Levels (N, 24, n, n) and (N, 40, m, m) of normalized pixels (N, 3, S, S)."""
        features = F.relu6(_conv_norm(self._conv_stem, self._bn0, pixels))
        hidden = F.relu6(_conv_norm(self._conv_hidden, self._bn1, features))
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
            out = F.relu6(_conv_norm(self._expand_conv, self._bn0, out))
        out = F.relu6(_conv_norm(self._depthwise_conv, self._bn1, out))
        projected = _conv_norm(self._project_conv, self._bn2, out)
        return features + projected if self._residual else projected


def _conv_norm(convolution: nn.Conv2d, norm: nn.BatchNorm2d, features: Tensor) -> Tensor:
    """A convolution and its batch normalization, as one operation if the statistics are fixed.

    Backpropagation through separate normalizations took a third of a training step.
    """
    if norm.training:
        normalized: Tensor = norm(_conv_same(features, convolution, convolution.weight))
        return normalized
    mean, variance = norm.running_mean, norm.running_var
    assert mean is not None
    assert variance is not None
    scale = norm.weight / torch.sqrt(variance + norm.eps)
    weight = convolution.weight * scale[:, None, None, None]
    return _conv_same(features, convolution, weight, norm.bias - mean * scale)


def _conv_same(
    features: Tensor, convolution: nn.Conv2d, weight: Tensor, bias: Tensor | None = None
) -> Tensor:
    """A convolution with TensorFlow's "same" padding: the output has ceil(side / stride) cells."""
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
