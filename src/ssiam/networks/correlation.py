"""Cross-correlation of search features with a template.

The template is an input of the network, so a convolution with it has weights that are not constant,
which TensorRT's parser rejects. Each correlation therefore has two equivalent forms: a convolution,
which is faster in PyTorch, and a sum of shifted slices, which every runtime accepts.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

__all__ = [
    "CorrelationHead",
    "correlate",
    "correlate_all",
    "correlate_all_sliced",
    "correlate_sliced",
    "sum_tensors",
]

_HIDDEN = 256  # channels of template, search and correlation (pysot)


def correlate(search: Tensor, kernel: Tensor) -> Tensor:
    """Each channel of `search` correlated with the same channel of `kernel`, without padding.

    Parameters
    ----------
    search : Tensor
        (N, C, H, W).
    kernel : Tensor
        (N, C, k, k).

    Returns
    -------
    Tensor
        (N, C, H - k + 1, W - k + 1). Depthwise correlation of SiamRPN++ (Li et al., CVPR 2019,
        section 3.4).
    """
    pairs = search.flatten(0, 1)[None]  # (1, N * C, H, W)
    kernels = kernel.flatten(0, 1)[:, None]  # (N * C, 1, k, k)
    maps = F.conv2d(pairs, kernels, groups=len(kernels))
    return maps.reshape(*search.shape[:2], *maps.shape[-2:])


def correlate_sliced(search: Tensor, kernel: Tensor) -> Tensor:
    """The same as `correlate`, computed as a weighted sum of k * k shifted slices of `search`."""
    rows, columns, side = _sizes(search, kernel)
    return sum_tensors(
        [
            search[:, :, i : i + rows, j : j + columns] * kernel[:, :, i : i + 1, j : j + 1]
            for i in range(side)
            for j in range(side)
        ]
    )


def correlate_all(search: Tensor, kernel: Tensor) -> Tensor:
    """Sum over the channels of `search` correlated with those of `kernel`, without padding.

    Parameters
    ----------
    search : Tensor
        (N, C, H, W).
    kernel : Tensor
        (1, C, k, k), the same for all N.

    Returns
    -------
    Tensor
        (N, 1, H - k + 1, W - k + 1). Equation 1 of SiamFC (Bertinetto et al., 2016), without bias.
    """
    return F.conv2d(search, kernel)


def correlate_all_sliced(search: Tensor, kernel: Tensor) -> Tensor:
    """The same as `correlate_all`, computed as a sum of k * k slices of one matrix product."""
    rows, columns, side = _sizes(search, kernel)
    taps = kernel[0].flatten(1).transpose(0, 1)  # (k * k, C)
    products = torch.matmul(taps, search.flatten(2))  # (N, k * k, H * W)
    maps = products.reshape(-1, side * side, *search.shape[-2:])
    return sum_tensors(
        [
            maps[:, i * side + j : i * side + j + 1, i : i + rows, j : j + columns]
            for i in range(side)
            for j in range(side)
        ]
    )


class CorrelationHead(nn.Module):
    """Response maps from template and search features: pysot's DepthwiseXCorr.

    Parameters
    ----------
    out_channels : int
        Channels of the maps: 2 per anchor for scores, 4 per anchor for boxes, 63 * 63 for masks.
    """

    def __init__(self, out_channels: int) -> None:
        super().__init__()
        self.conv_kernel = _conv_norm_relu(3)
        self.conv_search = _conv_norm_relu(3)
        self.head = nn.Sequential(*_conv_norm_relu(1), nn.Conv2d(_HIDDEN, out_channels, 1))

    def kernel(self, template: Tensor) -> Tensor:
        """Kernel (1, 256, k - 2, k - 2) of template features (1, 256, k, k)."""
        kernel: Tensor = self.conv_kernel(template)
        return kernel

    def correlation(self, search: Tensor, kernel: Tensor, *, sliced: bool = False) -> Tensor:
        """Correlation (1, 256, n, n) of search features (1, 256, s, s); n = s - k - 1."""
        features = self.conv_search(search)
        return correlate_sliced(features, kernel) if sliced else correlate(features, kernel)

    def maps(self, correlation: Tensor) -> Tensor:
        """Maps (1, out_channels, n, n) of a correlation, cell by cell."""
        maps: Tensor = self.head(correlation)
        return maps

    def forward(self, search: Tensor, kernel: Tensor, *, sliced: bool = False) -> Tensor:
        """Maps (1, out_channels, n, n) for search features and a kernel."""
        return self.maps(self.correlation(search, kernel, sliced=sliced))


def _conv_norm_relu(side: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(_HIDDEN, _HIDDEN, side, bias=False),
        nn.BatchNorm2d(_HIDDEN),
        nn.ReLU(inplace=True),
    )


def _sizes(search: Tensor, kernel: Tensor) -> tuple[int, int, int]:
    """Rows and columns of the correlation without padding, and the kernel's side."""
    side = int(kernel.shape[-1])
    return int(search.shape[-2]) - side + 1, int(search.shape[-1]) - side + 1, side


def sum_tensors(terms: Sequence[Tensor]) -> Tensor:
    """Sum of tensors of the same shape, added in order."""
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total
