"""MobileNetV2 of width 1.4 with dilated layers: the light backbone of SiamRPN++."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from torch import Tensor, nn

__all__ = ["MobileNetV2"]

_WIDTH: Final = 1.4


class _Layer(NamedTuple):
    expansion: int
    channels: int  # before multiplication by _WIDTH
    blocks: int
    stride: int
    dilation: int


_STEM: Final = 32  # channels, before multiplication by _WIDTH
_LAYERS: Final = (
    _Layer(1, 16, 1, 1, 1),
    _Layer(6, 24, 2, 2, 1),
    _Layer(6, 32, 3, 2, 1),
    _Layer(6, 64, 4, 1, 2),
    _Layer(6, 96, 3, 1, 2),
    _Layer(6, 160, 3, 1, 4),
    _Layer(6, 320, 1, 1, 4),
)


class MobileNetV2(nn.Module):
    """Features of several layers.

    From layer 3 on they have 15 x 15 cells for a crop of 127 px and 31 x 31 for one of 255 px.

    Parameters
    ----------
    levels : sequence of int
        Layers whose features are returned; 3, 5 and 7 have 44, 134 and 448 channels.
    """

    def __init__(self, levels: Sequence[int]) -> None:
        super().__init__()
        self._levels = tuple(levels)
        channels = _scaled(_STEM)
        self.layer0 = nn.Sequential(*_conv_norm(nn.Conv2d(3, channels, 3, stride=2, bias=False)))
        dilation = 1
        for number, layer in enumerate(_LAYERS, start=1):
            self.add_module(f"layer{number}", _make_layer(channels, layer, dilation))
            channels, dilation = _scaled(layer.channels), layer.dilation

    def forward(self, crop: Tensor) -> list[Tensor]:
        """Features of the chosen layers of a crop (1, 3, S, S), shallow to deep."""
        features: Tensor = self.layer0(crop)
        levels = []
        for number in range(1, max(self._levels) + 1):
            features = self.get_submodule(f"layer{number}")(features)
            if number in self._levels:
                levels.append(features)
        return levels


class _InvertedResidual(nn.Module):
    def __init__(
        self, channels: int, out: int, expansion: int, *, stride: int, dilation: int
    ) -> None:
        super().__init__()
        hidden = channels * expansion
        padding = dilation if dilation > 1 else 2 - stride
        self._residual = stride == 1 and channels == out
        self.conv = nn.Sequential(
            *_conv_norm(nn.Conv2d(channels, hidden, 1, bias=False)),
            *_conv_norm(
                nn.Conv2d(hidden, hidden, 3, stride, padding, dilation, groups=hidden, bias=False)
            ),
            *[nn.Conv2d(hidden, out, 1, bias=False), nn.BatchNorm2d(out)],
        )

    def forward(self, features: Tensor) -> Tensor:
        out: Tensor = self.conv(features)
        return features + out if self._residual else out


def _make_layer(channels: int, layer: _Layer, dilation_before: int) -> nn.Sequential:
    """A layer; if its dilation differs from the last one, the first block has half of it."""
    out = _scaled(layer.channels)
    changes = layer.dilation != dilation_before
    dilation = max(layer.dilation // 2, 1) if changes else layer.dilation
    blocks = [
        _InvertedResidual(channels, out, layer.expansion, stride=layer.stride, dilation=dilation)
    ]
    for _ in range(1, layer.blocks):
        blocks.append(
            _InvertedResidual(out, out, layer.expansion, stride=1, dilation=layer.dilation)
        )
    return nn.Sequential(*blocks)


def _conv_norm(convolution: nn.Conv2d) -> list[nn.Module]:
    return [convolution, nn.BatchNorm2d(convolution.out_channels), nn.ReLU6(inplace=True)]


def _scaled(channels: int) -> int:
    return int(channels * _WIDTH)
