"""ResNet-50 with dilation instead of strides: the backbone of SiamRPN++ and SiamMask.

Layers 3 and 4 keep stride 8 (SiamRPN++, section 3.2). The shortcuts of layers 2 to 4 are 3 x 3
convolutions, so the weights of a standard ResNet-50 do not fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from torch import Tensor, nn

__all__ = ["ResNet50"]

_EXPANSION: Final = 4  # output channels of a block per channel of its 3 x 3 convolution


class _Layer(NamedTuple):
    planes: int
    blocks: int
    stride: int
    dilation: int


_LAYERS: Final = {
    1: _Layer(64, 3, 1, 1),
    2: _Layer(128, 4, 2, 1),
    3: _Layer(256, 6, 1, 2),
    4: _Layer(512, 3, 1, 4),
}


class ResNet50(nn.Module):
    """Features of several layers.

    From layer 2 on they have 15 x 15 cells for a crop of 127 px and 31 x 31 for one of 255 px.

    Parameters
    ----------
    levels : sequence of int
        The features to return: 0 for the first convolution (64 channels, stride 2), 1 to 4 for
        the layers (256, 512, 1024 and 2048 channels). Deeper layers are not built.
    """

    def __init__(self, levels: Sequence[int]) -> None:
        super().__init__()
        self._levels = tuple(levels)
        self.conv1 = nn.Conv2d(3, 64, 7, stride=2, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.relu = nn.ReLU(inplace=True)
        self.maxpool = nn.MaxPool2d(3, stride=2, padding=1)
        channels = 64
        for number in range(1, max(levels) + 1):
            layer = _LAYERS[number]
            self.add_module(f"layer{number}", _make_layer(channels, layer))
            channels = layer.planes * _EXPANSION

    def forward(self, crop: Tensor) -> list[Tensor]:
        """Features of the chosen levels of a crop (1, 3, S, S), shallow to deep."""
        features: Tensor = self.relu(self.bn1(self.conv1(crop)))
        levels = {0: features}
        features = self.maxpool(features)
        for number in range(1, max(self._levels) + 1):
            features = self.get_submodule(f"layer{number}")(features)
            levels[number] = features
        return [levels[number] for number in self._levels]


class _Bottleneck(nn.Module):
    def __init__(self, channels: int, planes: int, spec: _ConvSpec, shortcut: nn.Module) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels, planes, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(planes)
        self.conv2 = _conv(planes, planes, 3, spec)
        self.bn2 = nn.BatchNorm2d(planes)
        self.conv3 = nn.Conv2d(planes, planes * _EXPANSION, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(planes * _EXPANSION)
        self.relu = nn.ReLU(inplace=True)
        self.downsample = shortcut

    def forward(self, features: Tensor) -> Tensor:
        out = self.relu(self.bn1(self.conv1(features)))
        out = self.relu(self.bn2(self.conv2(out)))
        out = self.bn3(self.conv3(out)) + self.downsample(features)
        activated: Tensor = self.relu(out)
        return activated


class _ConvSpec(NamedTuple):
    """Stride and dilation of a block's 3 x 3 convolution; with a stride it has no padding."""

    stride: int
    dilation: int

    @property
    def padding(self) -> int:
        return self.dilation if self.stride == 1 else 0


def _make_layer(channels: int, layer: _Layer) -> nn.Sequential:
    out = layer.planes * _EXPANSION
    first = _ConvSpec(layer.stride, max(layer.dilation // 2, 1))
    shortcut = nn.Sequential(_shortcut(channels, out, first, layer), nn.BatchNorm2d(out))
    blocks = [_Bottleneck(channels, layer.planes, first, shortcut)]
    for _ in range(1, layer.blocks):
        blocks.append(_Bottleneck(out, layer.planes, _ConvSpec(1, layer.dilation), nn.Identity()))
    return nn.Sequential(*blocks)


def _shortcut(channels: int, out: int, spec: _ConvSpec, layer: _Layer) -> nn.Conv2d:
    """1 x 1 if the layer has no stride or dilation, else like the block's 3 x 3 convolution."""
    if layer.stride == layer.dilation == 1:
        return nn.Conv2d(channels, out, 1, bias=False)
    return _conv(channels, out, 3, spec)


def _conv(channels: int, out: int, side: int, spec: _ConvSpec) -> nn.Conv2d:
    return nn.Conv2d(channels, out, side, spec.stride, spec.padding, spec.dilation, bias=False)
