"""Region proposal heads: scores and boxes of five anchors per cell, from one or more levels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch
from torch import Tensor, nn

from ssiam.networks.correlation import CorrelationHead, sum_tensors

__all__ = ["RPN", "MultiRPN"]

_ANCHORS: Final = 5  # per cell: one scale, five aspect ratios


class RPN(nn.Module):
    """Scores and boxes from one level of features (SiamRPN++, section 3.4)."""

    kernel_names = ("cls_kernel", "loc_kernel")

    def __init__(self) -> None:
        super().__init__()
        self.cls = CorrelationHead(2 * _ANCHORS)
        self.loc = CorrelationHead(4 * _ANCHORS)

    def kernels(self, templates: Sequence[Tensor]) -> list[Tensor]:
        """Kernels (1, 256, k - 2, k - 2) for scores and boxes of features [(1, 256, k, k)]."""
        (template,) = templates
        return [self.cls.kernel(template), self.loc.kernel(template)]

    def forward(
        self, searches: Sequence[Tensor], kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> tuple[Tensor, Tensor]:
        """Raw scores (1, 10, n, n) and boxes (1, 20, n, n) of search features [(1, 256, s, s)].

        The channels are (2, 5), background and foreground of each anchor, and (4, 5), its
        dx, dy, dw, dh.
        """
        (search,) = searches
        cls_kernel, loc_kernel = kernels
        cls: Tensor = self.cls(search, cls_kernel, sliced=sliced)
        loc: Tensor = self.loc(search, loc_kernel, sliced=sliced)
        return cls, loc


class MultiRPN(nn.Module):
    """Scores and boxes from several levels, as a weighted sum or their mean.

    Parameters
    ----------
    weighted : bool
        Whether levels are weighted by the softmax of learned weights (SiamRPN++, section 3.3);
        otherwise the mean is taken.
    levels : int
        Number of levels.
    """

    def __init__(self, *, weighted: bool, levels: int = 3) -> None:
        super().__init__()
        self._names = [f"rpn{number}" for number in range(2, 2 + levels)]
        for name in self._names:
            self.add_module(name, RPN())
        self._weighted = weighted
        if weighted:
            self.cls_weight = nn.Parameter(torch.ones(levels))
            self.loc_weight = nn.Parameter(torch.ones(levels))

    @property
    def kernel_names(self) -> tuple[str, ...]:
        """Names of the kernels, two per level."""
        return tuple(f"{name}_{kind}" for name in self._names for kind in RPN.kernel_names)

    def kernels(self, templates: Sequence[Tensor]) -> list[Tensor]:
        """Two kernels (1, 256, 5, 5) per level, in the order of `kernel_names`."""
        kernels: list[Tensor] = []
        for head, template in zip(self._heads(), templates, strict=True):
            kernels += head.kernels([template])
        return kernels

    def forward(
        self, searches: Sequence[Tensor], kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> tuple[Tensor, Tensor]:
        """Raw scores (1, 10, n, n) and boxes (1, 20, n, n) of features (1, 256, s, s) per level."""
        maps = [
            head([search], kernels[2 * i : 2 * i + 2], sliced=sliced)
            for i, (head, search) in enumerate(zip(self._heads(), searches, strict=True))
        ]
        cls_maps, loc_maps = zip(*maps, strict=True)
        if not self._weighted:
            return _mean(cls_maps), _mean(loc_maps)
        return _weighted_sum(cls_maps, self.cls_weight), _weighted_sum(loc_maps, self.loc_weight)

    def _heads(self) -> list[RPN]:
        heads = [self.get_submodule(name) for name in self._names]
        return [head for head in heads if isinstance(head, RPN)]


def _mean(maps: Sequence[Tensor]) -> Tensor:
    return sum_tensors(maps) / len(maps)


def _weighted_sum(maps: Sequence[Tensor], weights: Tensor) -> Tensor:
    shares = torch.softmax(weights, 0)
    return sum_tensors([share * level for share, level in zip(shares, maps, strict=True)])
