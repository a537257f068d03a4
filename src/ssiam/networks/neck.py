"""Necks: features of a backbone brought to 256 channels, templates cut to their middle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from torch import Tensor, nn

__all__ = ["MultiLevelNeck", "Neck", "NoNeck"]

CHANNELS: Final = 256
_TEMPLATE_SIDE: Final = 7  # cells kept of 15 (SiamRPN++, section 3.2)


class AdjustLayer(nn.Module):
    """1 x 1 convolution to 256 channels with normalisation and no activation.

    Parameters
    ----------
    channels : int
        Channels that come in.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.downsample = nn.Sequential(
            nn.Conv2d(channels, CHANNELS, 1, bias=False), nn.BatchNorm2d(CHANNELS)
        )

    def forward(self, features: Tensor) -> Tensor:
        """Features (1, 256, n, n) of (1, channels, n, n)."""
        adjusted: Tensor = self.downsample(features)
        return adjusted


class Neck(nn.Module):
    """Neck of one level, as SiamMask has it; it uses the deepest of the levels that it is given.

    Parameters
    ----------
    channels : int
        Channels of that level.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.downsample = AdjustLayer(channels)

    def template(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """Template features [(1, 256, 7, 7)] of levels that end in (1, channels, 15, 15)."""
        return [_middle(self.downsample(levels[-1]))]

    def search(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """Search features [(1, 256, n, n)] of levels that end in (1, channels, n, n)."""
        return [self.downsample(levels[-1])]


class MultiLevelNeck(nn.Module):
    """Neck of SiamRPN++'s three levels, from backbone layers that are named 2, 3 and 4.

    Parameters
    ----------
    channels : sequence of int
        Channels of the levels, shallow to deep.
    """

    def __init__(self, channels: Sequence[int]) -> None:
        super().__init__()
        self._names = [f"downsample{number}" for number in range(2, 2 + len(channels))]
        for name, width in zip(self._names, channels, strict=True):
            self.add_module(name, AdjustLayer(width))

    def template(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """Template features (1, 256, 7, 7) of each level (1, channels, 15, 15)."""
        return [_middle(level) for level in self.search(levels)]

    def search(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """Search features (1, 256, n, n) of each level (1, channels, n, n)."""
        layers = [self.get_submodule(name) for name in self._names]
        return [layer(level) for layer, level in zip(layers, levels, strict=True)]


class NoNeck(nn.Module):
    """For AlexNet, whose features are used as they are."""

    def template(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """The levels themselves."""
        return list(levels)

    def search(self, levels: Sequence[Tensor]) -> list[Tensor]:
        """The levels themselves."""
        return list(levels)


def _middle(features: Tensor) -> Tensor:
    start = (int(features.shape[-1]) - _TEMPLATE_SIDE) // 2
    middle = slice(start, start + _TEMPLATE_SIDE)
    return features[:, :, middle, middle]
