"""NanoTrack v3's network in PyTorch, with the parameter names of its checkpoint, for fine-tuning.

The architecture and the weights are the authors' (github.com/HonglinChu/SiamTrackers,
Apache-2.0): a thin MobileNetV3 (Howard et al., ICCV 2019) that ends at stride 16, and an
anchor-free head (SiamBAN, Chen et al., CVPR 2020) on a pixel-wise and a depthwise correlation.
Crops are BGR in 0..255 without further normalization. Batch normalizations are folded into the
preceding convolutions (`fold_batch_norms`), because their statistics stay fixed; this saves a fifth
of a training step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

__all__ = [
    "WIDTH",
    "NanoBackbone",
    "NanoHead",
    "NanoKernels",
    "NanoResponses",
    "fold_batch_norms",
]

WIDTH: Final = 96  # channels of the features at stride 16

_STEM: Final = 16  # channels at stride 2
_KERNEL_SIDE: Final = 8  # cells per side of a template's features
_CORE: Final = slice(2, 6)  # the central 4 x 4 of them, kernel of the depthwise correlation
_EPSILON: Final = 1e-5  # PyTorch's default for batch normalization
_TOWER: Final = 6  # pairs of a depthwise and a pointwise convolution


class _Block(NamedTuple):
    """An inverted residual block."""

    kernel: int  # side
    hidden: int  # channels after expansion
    channels: int  # of the output
    stride: int
    squeezed: int  # channels of the squeeze-and-excitation layer; 0: none
    hard_swish: bool  # otherwise ReLU


_BLOCKS: Final = (
    _Block(3, 16, 16, 2, 8, False),
    _Block(3, 72, 24, 2, 0, False),
    _Block(3, 88, 24, 1, 0, False),
    _Block(5, 96, 40, 2, 24, True),
    _Block(5, 240, 40, 1, 64, True),
    _Block(5, 240, 40, 1, 64, True),
    _Block(5, 120, 48, 1, 32, True),
    _Block(5, 144, 48, 1, 40, True),
    _Block(5, 288, 96, 1, 72, True),
)
_LOWER: Final = 4  # number of modules of `features` up to stride 8


class NanoKernels(NamedTuple):
    """Kernels of a template.

    Attributes
    ----------
    pixels_box, pixels_score : (N, 64, 96)
        Kernels of the pixel-wise correlation, one per cell of the template.
    core_box, core_score : (N, 96, 4, 4)
        Kernels of the depthwise correlation.
    """

    pixels_box: Tensor
    pixels_score: Tensor
    core_box: Tensor
    core_score: Tensor


class NanoResponses(NamedTuple):
    """Responses of a search crop on 15 x 15 cells of 16 px.

    Attributes
    ----------
    score : (N, 2, 15, 15)
        Logits of background and target.
    distances : (N, 4, 15, 15)
        From the cell's center to the target's left, top, right and bottom, px of the crop.
    tower : (N, 96, 15, 15)
        Features from which the distances are computed.
    """

    score: Tensor
    distances: Tensor
    tower: Tensor


def fold_batch_norms(weights: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Weights by name, with every batch normalization folded into the preceding convolution.

    A normalization is recognized by its `running_mean`. Its name ends with a number, that of the
    convolution plus 1.
    """
    result = dict(weights)
    for name in weights:
        if not name.endswith(".running_mean"):
            continue
        norm = name.removesuffix(".running_mean")
        parent, dot, number = norm.rpartition(".")
        convolution = f"{parent}{dot}{int(number) - 1}"
        scale, shift, mean, variance = (
            result.pop(f"{norm}.{part}")
            for part in ("weight", "bias", "running_mean", "running_var")
        )
        result.pop(f"{norm}.num_batches_tracked", None)
        factor = scale / torch.sqrt(variance + _EPSILON)
        bias = result.get(f"{convolution}.bias", torch.zeros_like(mean))
        result[f"{convolution}.weight"] = (
            result[f"{convolution}.weight"] * factor[:, None, None, None]
        )
        result[f"{convolution}.bias"] = (bias - mean) * factor + shift
    return result


class NanoBackbone(nn.Module):
    """Crop (N, 3, S, S) -> features at strides 8 and 16: (N, 24, n, n), (N, 96, n / 2, n / 2).

    A crop of 127 px gives 16 x 16 and 8 x 8 cells, one of 255 px gives 32 x 32 and 16 x 16.
    """

    def __init__(self) -> None:
        super().__init__()
        stem = nn.Sequential(
            nn.Conv2d(3, _STEM, 3, stride=2, padding=1),
            nn.Identity(),
            nn.Hardswish(),
        )
        blocks, channels = [], _STEM
        for block in _BLOCKS:
            blocks.append(_InvertedResidual(channels, block))
            channels = block.channels
        self.features = nn.Sequential(stem, *blocks)

    def forward(self, crop: Tensor) -> tuple[Tensor, Tensor]:
        """Features of a crop at strides 8 and 16."""
        fine = self.lower(crop)
        return fine, self.upper(fine)

    def lower(self, crop: Tensor) -> Tensor:
        """Features at stride 8 of a crop."""
        fine: Tensor = self.features[:_LOWER](crop)
        return fine

    def upper(self, fine: Tensor) -> Tensor:
        """Features at stride 16, computed from those at stride 8."""
        coarse: Tensor = self.features[_LOWER:](fine)
        return coarse

    def upper_parameters(self) -> list[nn.Parameter]:
        """Parameters of the layers after stride 8."""
        return list(self.features[_LOWER:].parameters())


class NanoHead(nn.Module):
    """Correlation of template and search features, then towers for boxes and scores."""

    def __init__(self) -> None:
        super().__init__()
        self.corr_pw_reg = _PixelCorrelation()
        self.corr_pw_cls = _PixelCorrelation()
        self.corr_dw_reg = _DepthwiseCorrelation()
        self.corr_dw_cls = _DepthwiseCorrelation()
        self.down_reg = nn.Sequential(nn.Conv2d(_KERNEL_SIDE**2 + WIDTH, WIDTH, 1))
        self.down_cls = nn.Sequential(nn.Conv2d(_KERNEL_SIDE**2 + WIDTH, WIDTH, 1))
        self.bbox_tower = _tower()
        self.cls_tower = _tower()
        self.cls_logits = nn.Sequential(nn.Conv2d(WIDTH, 2, 1))
        self.bbox_pred = nn.Sequential(nn.Conv2d(WIDTH, 4, 1))

    def kernels(self, template: Tensor) -> NanoKernels:
        """Kernels of a template's features (N, 96, 8, 8)."""
        core = template[:, :, _CORE, _CORE]
        return NanoKernels(
            self.corr_pw_reg.kernel(template),
            self.corr_pw_cls.kernel(template),
            self.corr_dw_reg.kernel(core),
            self.corr_dw_cls.kernel(core),
        )

    def forward(self, kernels: NanoKernels, search: Tensor) -> NanoResponses:
        """Responses of search features (N, 96, 16, 16)."""
        box = self.down_reg(
            torch.cat(
                [
                    self.corr_pw_reg(kernels.pixels_box, search),
                    self.corr_dw_reg(kernels.core_box, search),
                ],
                dim=1,
            )
        )
        score = self.down_cls(
            torch.cat(
                [
                    self.corr_pw_cls(kernels.pixels_score, search),
                    self.corr_dw_cls(kernels.core_score, search),
                ],
                dim=1,
            )
        )
        tower = self.bbox_tower(box)
        distances = torch.exp(self.bbox_pred(tower))
        return NanoResponses(self.cls_logits(self.cls_tower(score)), distances, tower)


class _InvertedResidual(nn.Module):
    """MobileNetV3's block: expansion, depthwise convolution, squeeze-and-excitation, projection.

    The first block has no expansion, and its squeeze-and-excitation follows the activation; in the
    others it precedes the activation.
    """

    def __init__(self, channels: int, block: _Block) -> None:
        super().__init__()
        depthwise = nn.Conv2d(
            block.hidden,
            block.hidden,
            block.kernel,
            stride=block.stride,
            padding=block.kernel // 2,
            groups=block.hidden,
        )
        projection = nn.Conv2d(block.hidden, block.channels, 1)
        excitation = _Excitation(block.hidden, block.squeezed) if block.squeezed else nn.Identity()
        if channels == block.hidden:
            layers = [depthwise, nn.Identity(), _activation(block), excitation]
        else:
            layers = [
                nn.Conv2d(channels, block.hidden, 1),
                nn.Identity(),
                _activation(block),
                depthwise,
                nn.Identity(),
                excitation,
                _activation(block),
            ]
        self.conv = nn.Sequential(*layers, projection)
        self._residual = block.stride == 1 and channels == block.channels

    def forward(self, features: Tensor) -> Tensor:
        out: Tensor = self.conv(features)
        return features + out if self._residual else out


class _Excitation(nn.Module):
    """Squeeze-and-excitation: scales each channel by a function of all channel means."""

    def __init__(self, channels: int, squeezed: int) -> None:
        super().__init__()
        self.fc = nn.Sequential(
            nn.Linear(channels, squeezed),
            nn.ReLU(inplace=True),
            nn.Linear(squeezed, channels),
            nn.Hardsigmoid(),
        )

    def forward(self, features: Tensor) -> Tensor:
        factors: Tensor = self.fc(features.mean(dim=(2, 3)))
        return features * factors[:, :, None, None]


class _PixelCorrelation(nn.Module):
    """Correlation of every template cell with every cell of the search crop (PG-Net)."""

    def __init__(self) -> None:
        super().__init__()
        cells = _KERNEL_SIDE**2
        self.conv_kernel = _pointwise()
        self.conv_search = _pointwise()
        self.CA_layer = _ChannelAttention(cells)
        self.conv = nn.Sequential(
            nn.Conv2d(cells, cells, 2, groups=cells),
            nn.Identity(),
            nn.ReLU6(inplace=True),
            nn.Conv2d(cells, cells, 1),
        )

    def kernel(self, template: Tensor) -> Tensor:
        cells: Tensor = self.conv_kernel(template)
        return cells.flatten(2).transpose(1, 2)

    def forward(self, kernel: Tensor, search: Tensor) -> Tensor:
        features = self.conv_search(search)
        correlation = torch.matmul(kernel, features.flatten(2))
        correlation = correlation.reshape(-1, _KERNEL_SIDE**2, *features.shape[2:])
        out: Tensor = self.conv(self.CA_layer(correlation))
        return out


class _ChannelAttention(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.fc1 = nn.Conv2d(channels, channels, 1)
        self.fc2 = nn.Conv2d(channels, channels, 1)

    def forward(self, features: Tensor) -> Tensor:
        mean = features.mean(dim=(2, 3), keepdim=True)
        return features * torch.sigmoid(self.fc2(F.relu(self.fc1(mean))))


class _DepthwiseCorrelation(nn.Module):
    """Depthwise correlation of the template's center with the search crop."""

    def __init__(self) -> None:
        super().__init__()
        self.conv_kernel = _pointwise()
        self.conv_search = _pointwise()

    def kernel(self, core: Tensor) -> Tensor:
        out: Tensor = self.conv_kernel(core)
        return out

    def forward(self, kernel: Tensor, search: Tensor) -> Tensor:
        features = self.conv_search(search)
        n, channels = features.shape[:2]
        pairs = features.reshape(1, n * channels, *features.shape[2:])
        weights = kernel.reshape(n * channels, 1, *kernel.shape[2:])
        out = F.conv2d(pairs, weights, padding=1, groups=n * channels)
        return out.reshape(n, channels, *out.shape[2:])


def _activation(block: _Block) -> nn.Module:
    return nn.Hardswish() if block.hard_swish else nn.ReLU(inplace=True)


def _pointwise() -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(WIDTH, WIDTH, 1))


def _tower() -> nn.Sequential:
    layers: list[nn.Module] = []
    for _ in range(_TOWER):
        layers += [
            nn.Conv2d(WIDTH, WIDTH, 3, padding=1, groups=WIDTH),
            nn.Identity(),
            nn.ReLU6(inplace=True),
            nn.Conv2d(WIDTH, WIDTH, 1),
            nn.Identity(),
        ]
    return nn.Sequential(*layers)
