"""Necks: reduce backbone features to 256 channels, and crop template features to the center."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from torch import Tensor, nn

__all__ = ["MultiLevelNeck", "Neck", "NoNeck"]

_CHANNELS: Final = 256
_TEMPLATE_SIDE: Final = 7  # central cells per side, out of 15 (SiamRPN++, section 3.2)


class _AdjustLayer(nn.Module):
    """1 x 1 convolution to 256 channels with batch normalization, without activation.

    Parameters
    ----------
    channels : int
        Channels of the input.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.downsample = nn.Sequential(
            nn.Conv2d(channels, _CHANNELS, 1, bias=False), nn.BatchNorm2d(_CHANNELS)
        )

    def forward(self, features: Tensor) -> Tensor:
        """(1, channels, n, n) -> (1, 256, n, n)."""
        adjusted: Tensor = self.downsample(features)
        return adjusted


class Neck(nn.Module):
    """Neck of SiamMask, which uses the deepest level only.

    Parameters
    ----------
    channels : int
        Channels of that level.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.downsample = _AdjustLayer(channels)

    def template(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """Template features [(1, 256, 7, 7)]; the last level is (1, channels, 15, 15)."""
        return [_center(self.downsample(levels[-1]))]

    def search(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """Search features [(1, 256, n, n)]; the last level is (1, channels, n, n)."""
        return [self.downsample(levels[-1])]


class MultiLevelNeck(nn.Module):
    """Neck of SiamRPN++, with a layer for each level. The layers are numbered from 2, as in pysot.

    Parameters
    ----------
    channels : sequence of int
        Channels of the levels, shallow to deep.
    """

    def __init__(self, channels: Sequence[int]) -> None:
        super().__init__()
        self._names = [f"downsample{number}" for number in range(2, 2 + len(channels))]
        for name, width in zip(self._names, channels, strict=True):
            self.add_module(name, _AdjustLayer(width))

    def template(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """Template features (1, 256, 7, 7) of each level (1, channels, 15, 15)."""
        return [_center(level) for level in self.search(levels)]

    def search(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """Search features (1, 256, n, n) of each level (1, channels, n, n)."""
        layers = [self.get_submodule(name) for name in self._names]
        return [layer(level) for layer, level in zip(layers, levels, strict=True)]


class NoNeck(nn.Module):
    """The identity, for AlexNet."""

    def template(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """The levels themselves."""
        return list(levels)

    def search(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """The levels themselves."""
        return list(levels)


def _center(features: Tensor) -> Tensor:
    start = (int(features.shape[-1]) - _TEMPLATE_SIDE) // 2
    cells = slice(start, start + _TEMPLATE_SIDE)
    return features[:, :, cells, cells]
