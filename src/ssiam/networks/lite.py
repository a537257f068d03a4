"""The network of `lite`: NanoTrack v3 with attention between template and search region.

Correlation compares the template with the search region. It cannot compare the parts of the search
region with each other, which is needed to distinguish the target from distractors. Here every cell
of the search region attends to the template, to a recent template and to the search region before
the correlation, as in HCAT (Chen et al., ECCV Workshops 2022) and MixFormerV2 (Cui et al., NeurIPS
2023). As in these, the template does not attend to the search region, so it is computed once. The
output layers of the attention blocks start at zero: the untrained network is NanoTrack v3.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple, cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ssiam.networks.base import SiameseNetwork
from ssiam.networks.nanotrack import WIDTH, NanoBackbone, NanoHead, NanoKernels

__all__ = ["ATTENTION_BLOCKS", "CELLS", "STRIDE", "LiteNetwork", "LiteResponses"]

STRIDE: Final = 16  # px of the search crop between cells
CELLS: Final = 15  # per side of the response maps
ATTENTION_BLOCKS: Final = 2

_HEADS: Final = 4
_EXPANSION: Final = 2  # hidden channels of a feed-forward layer per input channel
_TEMPLATE: Final = 8  # cells per side of a template's features
_SEARCH: Final = 16  # cells per side of a search crop's features
_POOLED: Final = 2  # cells per side that are averaged into one key of the search region
_POSITION: Final = 0.02  # initial standard deviation of the position embeddings


class LiteResponses(NamedTuple):
    """Responses of a search crop on 15 x 15 cells.

    Attributes
    ----------
    score : (N, 1, 15, 15)
        Logits: the cell is on the target.
    quality : (N, 1, 15, 15)
        Logits of the overlap (IoU) of the cell's box with the target.
    distances : (N, 4, 15, 15)
        From the cell's center to the left, top, right and bottom of the target, px of the crop.
    """

    score: Tensor
    quality: Tensor
    distances: Tensor


class LiteNetwork(SiameseNetwork):
    """Score, box distances and box quality.

    Crops are BGR in 0..255, float32. The center of cell (row, column) is at ((column - 7) * 16,
    (row - 7) * 16) px from the center of the search crop.

    Parameters
    ----------
    attention : int
        Number of attention blocks; with 0 there is only the correlation.
    """

    kernel_names = (*NanoKernels._fields, "context")
    response_names = LiteResponses._fields

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

        The kernels are those of `NanoKernels`. The context (N, A, 2, 96, 64) holds the keys and
        values of every cell for each of A attention blocks.
        """
        return self.kernels(self.backbone(crop)[1])

    def kernels(self, features: Tensor) -> tuple[Tensor, ...]:
        """Kernels and context of a template's features (N, 96, 8, 8)."""
        features, context = self.relation.template(features)
        return *self.head.kernels(features), context

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> LiteResponses:
        """Responses of a search crop (N, 3, 255, 255); `sliced` has no effect.

        `kernels` are the output of `template`, optionally followed by the context of a recent
        template. By default that is the context of the first template.
        """
        return self.responses(self.backbone(crop)[1], kernels)

    def responses(self, features: Tensor, kernels: Sequence[Tensor]) -> LiteResponses:
        """Responses of a search crop's features (N, 96, 16, 16); `kernels` as for `search`."""
        *correlated, context = kernels[: len(self.kernel_names)]
        recent = kernels[len(self.kernel_names)] if len(kernels) > len(self.kernel_names) else None
        attended = self.relation(features, context, context if recent is None else recent)
        responses = self.head(NanoKernels(*correlated), attended)
        score = responses.score[:, 1:] - responses.score[:, :1]
        return LiteResponses(score, self.quality(responses.tower), responses.distances)


class _Relation(nn.Module):
    """Attention blocks on features at stride 16."""

    def __init__(self, blocks: int) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(_Block() for _ in range(blocks))
        self.in_template = _position(_TEMPLATE)
        self.in_search = _position(_SEARCH)

    def template(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Features (N, 96, 8, 8) after self-attention, and their context."""
        contexts = []
        for block in cast(Iterable[_Block], self.blocks):
            features, context = block.template(features, self.in_template)
            contexts.append(context)
        if not contexts:
            return features, features.new_zeros(len(features), 1, 2, WIDTH, _TEMPLATE**2)
        return features, torch.stack(contexts, dim=1)

    def forward(self, features: Tensor, context: Tensor, recent: Tensor) -> Tensor:
        """Features (N, 96, 16, 16) after attention to two templates and to themselves."""
        position = self.in_search
        for number, block in enumerate(self.blocks):
            features = block(features, position, context[:, number], recent[:, number])
        return features


class _Block(nn.Module):
    """Residual attention and feed-forward layer; the residuals are zero before training.

    There is no layer normalization: the features have a fixed scale, and a normalization over
    channels would take as long as the rest of the block.
    """

    def __init__(self) -> None:
        super().__init__()
        self.query = nn.Conv2d(WIDTH, WIDTH, 1)
        self.key = nn.Conv2d(WIDTH, WIDTH, 1)
        self.value = nn.Conv2d(WIDTH, WIDTH, 1)
        self.recent_key = nn.Parameter(torch.zeros(WIDTH, 1))
        self.out = _zero_init(nn.Conv2d(WIDTH, WIDTH, 1))
        self.widen = nn.Conv2d(WIDTH, _EXPANSION * WIDTH, 1)
        self.narrow = _zero_init(nn.Conv2d(_EXPANSION * WIDTH, WIDTH, 1))

    def template(self, features: Tensor, position: Tensor) -> tuple[Tensor, Tensor]:
        """Features (N, 96, 8, 8) of a template after the block, and its keys and values."""
        key, value = self._key_value(features, position)
        attended = self._attend(features, position, key, value)
        return attended, torch.stack([key, value], dim=1)

    def forward(self, features: Tensor, position: Tensor, first: Tensor, recent: Tensor) -> Tensor:
        """Features (N, 96, 16, 16) of a search region after the block.

        `first` and `recent` (N, 2, 96, 64) are the keys and values of two templates.
        """
        key, value = self._key_value(_pooled(features), _pooled(position))
        key = torch.cat([first[:, 0], recent[:, 0] + self.recent_key, key], dim=2)
        value = torch.cat([first[:, 1], recent[:, 1], value], dim=2)
        return self._attend(features, position, key, value)

    def _key_value(self, features: Tensor, position: Tensor) -> tuple[Tensor, Tensor]:
        """Keys and values (N, 96, n * n) of features (N, 96, n, n)."""
        key: Tensor = self.key(features) + position
        value: Tensor = self.value(features)
        return key.flatten(2), value.flatten(2)

    def _attend(self, features: Tensor, position: Tensor, key: Tensor, value: Tensor) -> Tensor:
        query = self.query(features) + position
        features = features + self.out(_attention(query, key, value))
        residual: Tensor = self.narrow(F.hardswish(self.widen(features)))
        return features + residual


def _attention(query: Tensor, key: Tensor, value: Tensor) -> Tensor:
    """Scaled dot-product attention (Vaswani et al., NIPS 2017) in `_HEADS` heads.

    Queries (N, 96, n, n); keys and values (N, 96, K).
    """
    channels = WIDTH // _HEADS
    queries = query.reshape(-1, _HEADS, channels, query.shape[2] * query.shape[3])
    keys, values = (part.reshape(-1, _HEADS, channels, part.shape[2]) for part in (key, value))
    weights = torch.softmax(queries.transpose(2, 3) @ keys * channels**-0.5, dim=3)
    return (values @ weights.transpose(2, 3)).reshape(query.shape)


def _pooled(features: Tensor) -> Tensor:
    return F.avg_pool2d(features, _POOLED)


def _position(side: int) -> nn.Parameter:
    return nn.Parameter(torch.randn(1, WIDTH, side, side) * _POSITION)


def _zero_init(layer: nn.Conv2d) -> nn.Conv2d:
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
    return layer
