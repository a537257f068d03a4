"""Cross-correlation of search features with a template, the heart of the Siamese trackers.

The template is an input of the network, so a plain convolution would have a weight that is not
constant, which TensorRT's parser rejects. Each correlation therefore has two forms of equal value:
a convolution, quick in PyTorch, and a sum of shifted slices, which every runtime takes.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

__all__ = [
    "CorrelationHead",
    "added",
    "correlate",
    "correlate_all",
    "correlate_all_sliced",
    "correlate_sliced",
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
    """What `correlate` returns, as k * k shifted slices of `search`, weighted and added."""
    rows, columns, side = _valid(search, kernel)
    return added(
        [
            search[:, :, i : i + rows, j : j + columns] * kernel[:, :, i : i + 1, j : j + 1]
            for i in range(side)
            for j in range(side)
        ]
    )


def correlate_all(search: Tensor, kernel: Tensor) -> Tensor:
    """All channels of `search` correlated with those of `kernel` and added, without padding.

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
    """What `correlate_all` returns, as one matrix product and k * k shifted slices of it."""
    rows, columns, side = _valid(search, kernel)
    taps = kernel[0].flatten(1).transpose(0, 1)  # (k * k, C)
    products = torch.matmul(taps, search.flatten(2))  # (N, k * k, H * W)
    maps = products.reshape(-1, side * side, *search.shape[-2:])
    return added(
        [
            maps[:, i * side + j : i * side + j + 1, i : i + rows, j : j + columns]
            for i in range(side)
            for j in range(side)
        ]
    )


class CorrelationHead(nn.Module):
    """Maps of one kind from template and search features: pysot's DepthwiseXCorr.

    Parameters
    ----------
    out_channels : int
        Channels of the maps: 2 an anchor for scores, 4 an anchor for boxes, 63 * 63 for masks.
    """

    def __init__(self, out_channels: int) -> None:
        super().__init__()
        self.conv_kernel = _convolved(3)
        self.conv_search = _convolved(3)
        self.head = nn.Sequential(*_convolved(1), nn.Conv2d(_HIDDEN, out_channels, 1))

    def kernel(self, template: Tensor) -> Tensor:
        """Kernel (1, 256, k - 2, k - 2) of template features (1, 256, k, k)."""
        kernel: Tensor = self.conv_kernel(template)
        return kernel

    def correlation(self, search: Tensor, kernel: Tensor, *, sliced: bool = False) -> Tensor:
        """Correlation (1, 256, n, n) of search features (1, 256, s, s); n = s - 2 - k + 1."""
        features = self.conv_search(search)
        return correlate_sliced(features, kernel) if sliced else correlate(features, kernel)

    def maps(self, correlation: Tensor) -> Tensor:
        """Maps (1, out_channels, n, n) of a correlation, cell by cell."""
        maps: Tensor = self.head(correlation)
        return maps

    def forward(self, search: Tensor, kernel: Tensor, *, sliced: bool = False) -> Tensor:
        """Maps (1, out_channels, n, n) for search features and a kernel."""
        return self.maps(self.correlation(search, kernel, sliced=sliced))


def _convolved(side: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(_HIDDEN, _HIDDEN, side, bias=False),
        nn.BatchNorm2d(_HIDDEN),
        nn.ReLU(inplace=True),
    )


def _valid(search: Tensor, kernel: Tensor) -> tuple[int, int, int]:
    """Rows and columns of the correlation, and the kernel's side."""
    side = int(kernel.shape[-1])
    return int(search.shape[-2]) - side + 1, int(search.shape[-1]) - side + 1, side


def added(terms: Sequence[Tensor]) -> Tensor:
    """Sum of tensors of one shape."""
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total
