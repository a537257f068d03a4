"""AlexNet without padding, in the variants of SiamFC and SiamRPN++."""

from __future__ import annotations

from typing import Final

from torch import Tensor, nn

__all__ = ["AlexNet", "AlexNetV1"]

_SIAMFC_EPS: Final = 1e-6  # of batch normalization (siamfc-pytorch)
_SIAMFC_MOMENTUM: Final = 0.05


class AlexNet(nn.Module):
    """Backbone of siamrpn_alex_dwxcorr: pooling before the ReLU, no ReLU after the last layer.

    Crops (1, 3, 127, 127) give (1, 256, 6, 6), crops (1, 3, 287, 287) give (1, 256, 26, 26).
    """

    def __init__(self) -> None:
        super().__init__()
        self.features = nn.Sequential(
            *[nn.Conv2d(3, 96, 11, stride=2), nn.BatchNorm2d(96), _pool(), _relu()],
            *[nn.Conv2d(96, 256, 5), nn.BatchNorm2d(256), _pool(), _relu()],
            *[nn.Conv2d(256, 384, 3), nn.BatchNorm2d(384), _relu()],
            *[nn.Conv2d(384, 384, 3), nn.BatchNorm2d(384), _relu()],
            *[nn.Conv2d(384, 256, 3), nn.BatchNorm2d(256)],
        )

    def forward(self, crop: Tensor) -> list[Tensor]:
        """Features (1, 256, n, n) of a crop (1, 3, S, S), as a list of one level."""
        return [self.features(crop)]


class AlexNetV1(nn.Module):
    """Backbone of SiamFC: pooling after the ReLU, three convolutions in two groups.

    Crops (N, 3, 127, 127) give (N, 256, 6, 6), crops (N, 3, 255, 255) give (N, 256, 22, 22).
    """

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = _siamfc_stage(nn.Conv2d(3, 96, 11, stride=2), pooled=True)
        self.conv2 = _siamfc_stage(nn.Conv2d(96, 256, 5, groups=2), pooled=True)
        self.conv3 = _siamfc_stage(nn.Conv2d(256, 384, 3), pooled=False)
        self.conv4 = _siamfc_stage(nn.Conv2d(384, 384, 3, groups=2), pooled=False)
        self.conv5 = nn.Sequential(nn.Conv2d(384, 256, 3, groups=2))

    def forward(self, crop: Tensor) -> Tensor:
        """Features (N, 256, n, n) of crops (N, 3, S, S)."""
        features: Tensor = self.conv2(self.conv1(crop))
        features = self.conv5(self.conv4(self.conv3(features)))
        return features


def _siamfc_stage(convolution: nn.Conv2d, *, pooled: bool) -> nn.Sequential:
    norm = nn.BatchNorm2d(convolution.out_channels, _SIAMFC_EPS, _SIAMFC_MOMENTUM)
    return nn.Sequential(convolution, norm, _relu(), *([_pool()] if pooled else []))


def _pool() -> nn.Module:
    return nn.MaxPool2d(3, stride=2)


def _relu() -> nn.Module:
    return nn.ReLU(inplace=True)
