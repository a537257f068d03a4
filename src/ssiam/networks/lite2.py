"""The second network of `lite`: NanoTrack v3's, with attention between template and search region.

Correlation compares parts of the template with parts of the search region; it cannot compare the
parts of the search region with each other, which is what tells two of a kind apart. Here every
cell of the search region attends to the template, to a recent template, and to the search region
before it is correlated (as in HCAT, Chen et al., ECCV Workshops 2022, and MixFormerV2, Cui et al.,
NeurIPS 2023, whose template does not attend to the search region either, so that it is computed
once). Every addition begins with zero weights: the untrained network is NanoTrack v3.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple, cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.networks.nanotrack import (
    WIDTH,
    NanoBackbone,
    NanoHead,
    NanoKernels,
)
from ssiam.networks.siamese import SiameseNetwork

__all__ = ["ATTENTION_BLOCKS", "CELLS", "STRIDE", "Lite2Network", "Lite2Responses"]

STRIDE: Final = 16  # px of the search crop between cells
CELLS: Final = 15  # a side, of the response maps
ATTENTION_BLOCKS: Final = 2

_HEADS: Final = 4
_WIDENED: Final = 2  # hidden channels of a feed-forward layer, for each of its inputs
_TEMPLATE: Final = 8  # cells a side of a template's features
_SEARCH: Final = 16  # cells a side of a search crop's features
_POOLED: Final = 2  # cells a side that make one key of the search region
_POSITION: Final = 0.02  # standard deviation of the position embeddings at first


class Lite2Responses(NamedTuple):
    """Responses of a search crop on 15 x 15 cells.

    Attributes
    ----------
    score : (N, 1, 15, 15)
        Logits: the cell lies on the target.
    quality : (N, 1, 15, 15)
        Logits of the overlap (IoU) of the cell's box with the target.
    distances : (N, 4, 15, 15)
        From the cell's center to the left, top, right and bottom of the target, px of the crop.
    """

    score: Tensor
    quality: Tensor
    distances: Tensor


class Lite2Network(SiameseNetwork):
    """Scores, box distances and their quality.

    Crops are BGR in 0..255, float32. The center of cell (row, column) lies at ((column - 7) * 16,
    (row - 7) * 16) px from the search crop's middle pixel.

    Parameters
    ----------
    attention : int
        Number of attention blocks; 0: correlation alone.
    """

    kernel_names = (*NanoKernels._fields, "context")
    response_names = Lite2Responses._fields

    def __init__(self, attention: int = ATTENTION_BLOCKS) -> None:
        super().__init__()
        self.backbone = NanoBackbone()
        self.relation = _Relation(attention)
        self.head = NanoHead()
        self.quality = nn.Conv2d(WIDTH, 1, 1)
        nn.init.zeros_(self.quality.weight)
        nn.init.zeros_(self.quality.bias)  # type: ignore[arg-type]

    def template(self, crop: Tensor) -> tuple[Tensor, ...]:
        """Kernels and context of a template crop (N, 3, 127, 127).

        Returns those of `NanoKernels`, and the context (N, A, 2, 64, 96): keys and values of every
        cell in each of A attention blocks.
        """
        return self.kernels(self.backbone(crop)[1])

    def kernels(self, features: Tensor) -> tuple[Tensor, ...]:
        """Kernels and context of a template's features (N, 96, 8, 8)."""
        features, context = self.relation.template(features)
        return *self.head.kernels(features), context

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> Lite2Responses:
        """Responses of a search crop (N, 3, 255, 255); `sliced` makes no difference.

        `kernels` are those of `template`, and perhaps the context of a recent template behind
        them; without, the first one counts as recent.
        """
        return self.responses(self.backbone(crop)[1], kernels)

    def responses(self, features: Tensor, kernels: Sequence[Tensor]) -> Lite2Responses:
        """Responses of a search crop's features (N, 96, 16, 16)."""
        *correlated, context = kernels[: len(self.kernel_names)]
        recent = kernels[len(self.kernel_names)] if len(kernels) > len(self.kernel_names) else None
        related = self.relation(features, context, context if recent is None else recent)
        seen = self.head(NanoKernels(*correlated), related)
        score = seen.score[:, 1:] - seen.score[:, :1]
        return Lite2Responses(score, self.quality(seen.tower), seen.distances)


class _Relation(nn.Module):
    """Attention blocks that add to features at stride 16 what their surroundings tell of them."""

    def __init__(self, blocks: int) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(_Block() for _ in range(blocks))
        self.in_template = _position(_TEMPLATE)
        self.in_search = _position(_SEARCH)

    def template(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Features (N, 96, 8, 8) after self-attention, and their context."""
        tokens, contexts = _tokens(features), []
        for block in cast(Iterable[_Block], self.blocks):
            tokens, context = block.template(tokens, self.in_template)
            contexts.append(context)
        if not contexts:
            return features, features.new_zeros(len(features), 1, 2, _TEMPLATE**2, WIDTH)
        return _maps(tokens, _TEMPLATE), torch.stack(contexts, dim=1)

    def forward(self, features: Tensor, context: Tensor, recent: Tensor) -> Tensor:
        """Features (N, 96, 16, 16) after attention to two templates and to themselves."""
        tokens, place = _tokens(features), self.in_search
        for number, block in enumerate(self.blocks):
            tokens = block(tokens, place, context[:, number], recent[:, number])
        return _maps(tokens, _SEARCH) if self.blocks else features


class _Block(nn.Module):
    """Attention and a feed-forward layer, each added to what came in; both begin with zeros."""

    def __init__(self) -> None:
        super().__init__()
        self.before_attention = nn.LayerNorm(WIDTH)
        self.query = nn.Linear(WIDTH, WIDTH)
        self.key_value = nn.Linear(WIDTH, 2 * WIDTH)
        self.recent_key = nn.Parameter(torch.zeros(WIDTH))
        self.out = _silent(nn.Linear(WIDTH, WIDTH))
        self.before_layers = nn.LayerNorm(WIDTH)
        self.widen = nn.Linear(WIDTH, _WIDENED * WIDTH)
        self.narrow = _silent(nn.Linear(_WIDENED * WIDTH, WIDTH))

    def template(self, tokens: Tensor, position: Tensor) -> tuple[Tensor, Tensor]:
        """Tokens (N, 64, 96) of a template after the block, and their keys and values."""
        normed = self.before_attention(tokens)
        key, value = self._key_value(normed, position)
        tokens = self._attended(tokens, normed, position, key, value)
        return tokens, torch.stack([key, value], dim=1)

    def forward(self, tokens: Tensor, position: Tensor, first: Tensor, recent: Tensor) -> Tensor:
        """Tokens (N, 256, 96) of a search region after the block.

        `first` and `recent` (N, 2, 64, 96) are keys and values of two templates.
        """
        normed = self.before_attention(tokens)
        key, value = self._key_value(_pooled(normed), _pooled(position))
        key = torch.cat([first[:, 0], recent[:, 0] + self.recent_key, key], dim=1)
        value = torch.cat([first[:, 1], recent[:, 1], value], dim=1)
        return self._attended(tokens, normed, position, key, value)

    def _key_value(self, normed: Tensor, position: Tensor) -> tuple[Tensor, Tensor]:
        key, value = self.key_value(normed).chunk(2, dim=-1)
        return key + position, value

    def _attended(
        self, tokens: Tensor, normed: Tensor, position: Tensor, key: Tensor, value: Tensor
    ) -> Tensor:
        query = self.query(normed) + position
        tokens = tokens + self.out(_attention(query, key, value))
        layers = F.hardswish(self.widen(self.before_layers(tokens)))
        added: Tensor = self.narrow(layers)
        return tokens + added


def _attention(query: Tensor, key: Tensor, value: Tensor) -> Tensor:
    """Scaled dot-product attention (Vaswani et al., NIPS 2017) in `_HEADS` heads."""
    query, key, value = (
        each.reshape(*each.shape[:2], _HEADS, WIDTH // _HEADS).transpose(1, 2)
        for each in (query, key, value)
    )
    weights = torch.softmax(query @ key.transpose(2, 3) * (WIDTH // _HEADS) ** -0.5, dim=-1)
    return (weights @ value).transpose(1, 2).flatten(2)


def _pooled(tokens: Tensor) -> Tensor:
    """Tokens (N, 64, 96): means of 2 x 2 cells of a search region's (N, 256, 96)."""
    side = _SEARCH // _POOLED
    cells = tokens.reshape(-1, side, _POOLED, side, _POOLED, WIDTH)
    return cells.mean(dim=(2, 4)).reshape(-1, side * side, WIDTH)


def _position(side: int) -> nn.Parameter:
    return nn.Parameter(torch.randn(1, side * side, WIDTH) * _POSITION)


def _silent(layer: nn.Linear) -> nn.Linear:
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


def _tokens(maps: Tensor) -> Tensor:
    return maps.flatten(2).transpose(1, 2)


def _maps(tokens: Tensor, side: int) -> Tensor:
    return tokens.transpose(1, 2).reshape(-1, WIDTH, side, side)
