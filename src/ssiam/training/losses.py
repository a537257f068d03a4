"""How wrong the network's responses are, for pairs whose target is known."""

from __future__ import annotations

from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from ssiam.networks.lite import LiteResponses
from ssiam.training.settings import LossSettings
from ssiam.training.targets import Targets, cell_targets, corners_of, decoded

__all__ = [
    "Truth",
    "box_loss",
    "cross_entropy",
    "mask_losses",
    "mean",
    "overlaps",
    "pair_losses",
    "score_loss",
]

_ALPHA: Final = 0.25  # of the focal loss (Lin et al., ICCV 2017, table 1b)
_GAMMA: Final = 2.0
_LEAST: Final = 1e-6


class Truth(NamedTuple):
    """What is known of N pairs: the fields of `Batch` as tensors, `mask` as float32 in 0..1."""

    box: Tensor
    present: Tensor
    mask: Tensor
    masked: Tensor
    weight: Tensor


def pair_losses(
    responses: LiteResponses, truth: Truth, settings: LossSettings
) -> dict[str, Tensor]:
    """The losses by name, each multiplied by its weight in the settings.

    Parameters
    ----------
    responses : LiteResponses
    truth : Truth
    settings : LossSettings
    """
    targets = cell_targets(truth.box, truth.present)
    cells = truth.weight[:, None, None] * targets.positive  # weight of each box
    boxes = decoded(responses.distances)
    wanted = corners_of(truth.box)[:, :, None, None]
    iou, giou = overlaps(boxes, wanted)
    by_name = {
        "score": score_loss(responses.score[:, 0], targets, truth.weight, settings),
        "box": mean(box_loss(iou, giou, settings.kind_of_box), cells),
        "quality": mean(cross_entropy(responses.quality[:, 0], iou.detach()), cells),
        "mask": _mask_loss(responses.mask[:, 0], truth),
    }
    return {name: getattr(settings, name) * loss for name, loss in by_name.items()}


def overlaps(boxes: Tensor, others: Tensor) -> tuple[Tensor, Tensor]:
    """IoU and generalised IoU (Rezatofighi et al., CVPR 2019) of boxes (N, 4, ...) -> (N, ...).

    Boxes are left, top, right, bottom.
    """
    shared = _area(
        torch.maximum(boxes[:, :2], others[:, :2]), torch.minimum(boxes[:, 2:], others[:, 2:])
    )
    around = _area(
        torch.minimum(boxes[:, :2], others[:, :2]), torch.maximum(boxes[:, 2:], others[:, 2:])
    )
    both = _area(boxes[:, :2], boxes[:, 2:]) + _area(others[:, :2], others[:, 2:]) - shared
    iou = shared / both.clamp(min=_LEAST)
    return iou, iou - (around - both) / around.clamp(min=_LEAST)


def box_loss(iou: Tensor, giou: Tensor, kind: str) -> Tensor:
    """Loss of each box by its overlaps: 1 - GIoU, or -log IoU."""
    return 1 - giou if kind == "giou" else -torch.log(iou.clamp(min=1e-3))


def score_loss(logits: Tensor, targets: Targets, weight: Tensor, settings: LossSettings) -> Tensor:
    """Focal or balanced loss of score logits (N, n, n); `weight` (N,) is that of each pair."""
    positive = targets.positive.float()
    counted = weight[:, None, None] * ~targets.ignored
    entropy = cross_entropy(logits, positive)
    if settings.kind_of_score == "balanced":
        on, off = counted * positive, counted * (1 - positive)
        return (mean(entropy, on) + mean(entropy, off)) / 2
    wrong = torch.where(targets.positive, 1 - logits.sigmoid(), logits.sigmoid())
    alpha = torch.where(targets.positive, _ALPHA, 1 - _ALPHA)
    focal = alpha * wrong**_GAMMA * entropy * counted
    return focal.sum() / (counted * positive).sum().clamp(min=1)


def _mask_loss(logits: Tensor, truth: Truth) -> Tensor:
    """Cross-entropy and, where there is a target, 1 - Dice; means over the pairs with masks.

    Dice as of V-Net (Milletari et al., 3DV 2016), which is 1 for shares that are met as well.
    """
    weight = truth.weight * truth.masked
    entropy, dice = _mask_terms(logits, truth.mask)
    return mean(entropy, weight) + mean(dice, weight * truth.present)


def mask_losses(logits: Tensor, mask: Tensor) -> dict[str, Tensor]:
    """Cross-entropy and 1 - Dice of mask logits (N, n, n) against covered shares 0..1."""
    entropy, dice = _mask_terms(logits, mask)
    return {"mask": entropy.mean(), "dice": dice.mean()}


def _mask_terms(logits: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Mean cross-entropy and 1 - Dice (N,) of each mask."""
    entropy = cross_entropy(logits, mask).mean(dim=(1, 2))
    inside, both = logits.sigmoid(), (1, 2)
    shared = 2 * (inside * mask).sum(dim=both) + 1
    dice = 1 - shared / (inside.square().sum(dim=both) + mask.square().sum(dim=both) + 1)
    return entropy, dice


def cross_entropy(logits: Tensor, probability: Tensor) -> Tensor:
    """Binary cross-entropy of every logit."""
    return F.binary_cross_entropy_with_logits(logits, probability, reduction="none")


def mean(values: Tensor, weights: Tensor) -> Tensor:
    """Weighted mean; 0 where nothing counts."""
    return (values * weights).sum() / weights.sum().clamp(min=1)


def _area(low: Tensor, high: Tensor) -> Tensor:
    return (high - low).clamp(min=0).prod(dim=1)
