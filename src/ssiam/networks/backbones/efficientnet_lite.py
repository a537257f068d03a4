"""EfficientNet-Lite0 up to stride 16, without its last two residual blocks there.

EfficientNet (Tan and Le, ICML 2019) without squeeze-and-excitation and with ReLU6, the variant that
its authors published for phones. Parameter names are those of the published checkpoint. Padding is
TensorFlow's "same": if the total is odd, the extra row is at the bottom and the extra column on the
right.
"""

from __future__ import annotations

from itertools import islice
from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

__all__ = ["CHANNELS", "EfficientNetLite0"]

CHANNELS: Final = (24, 40, 112)  # of the levels: strides 4, 8 and 16

_MEAN, _DEVIATION = 127.0, 128.0  # pixel normalization of the published weights
_STEM: Final = 32  # channels


class _Block(NamedTuple):
    channels: int  # of the output
    side: int  # of the depthwise kernel
    stride: int = 1
    expansion: int = 6


_STAGES: Final = (  # each ends with a level
    (_Block(16, 3, expansion=1), _Block(24, 3, 2), _Block(24, 3)),
    (_Block(40, 5, 2), _Block(40, 5)),
    (_Block(80, 3, 2), _Block(80, 3), _Block(80, 3), _Block(112, 5)),
)


class EfficientNetLite0(nn.Module):
    """Features of strides 4, 8 and 16: 32, 16 and 8 cells per side for a crop of 128 px.

    Crops are (N, 3, S, S) float32 BGR in 0..255; the levels have `CHANNELS` channels.
    """

    def __init__(self) -> None:
        super().__init__()
        self._conv_stem = nn.Conv2d(3, _STEM, 3, stride=2, bias=False)
        self._bn0 = _norm(_STEM)
        self._blocks = nn.ModuleDict()
        channels = _STEM
        for number, block in enumerate(block for stage in _STAGES for block in stage):
            self._blocks[str(number)] = _InvertedResidual(channels, block)
            channels = block.channels

    def forward(self, crop: Tensor) -> list[Tensor]:
        """Levels (N, 24, n, n), (N, 40, m, m) and (N, 112, k, k) of a crop (N, 3, S, S)."""
        features = F.relu6(_conv_norm(self._conv_stem, self._bn0, (crop - _MEAN) / _DEVIATION))
        blocks, levels = iter(self._blocks.values()), []
        for stage in _STAGES:
            for block in islice(blocks, len(stage)):
                features = block(features)
            levels.append(features)
        return levels


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
