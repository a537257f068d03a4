"""Losses of the second network of `lite`: of the truth, of distractors, and of what tutors say."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

from ssiam.networks.lite2 import CELLS, STRIDE, Lite2Responses
from ssiam.training.batches import Batch, Lessons
from ssiam.training.losses import box_loss, cross_entropy, mean, overlaps, score_loss
from ssiam.training.settings import LossSettings, TeacherSettings, TrainSettings
from ssiam.training.targets import Targets, cell_targets, corners_of, decoded

__all__ = ["lite2_losses"]

_SEES: Final = 0.3  # probability from which a tutor's box counts
_FAR: Final = 1e4  # logits, below any


def lite2_losses(
    responses: Lite2Responses, batch: Batch, settings: TrainSettings
) -> dict[str, Tensor]:
    """The losses by name, each multiplied by its weight in the settings."""
    box, present = torch.from_numpy(batch.box), torch.from_numpy(batch.present)
    weight, own = torch.from_numpy(batch.weight), settings.losses
    targets = cell_targets(box, present, CELLS, STRIDE)
    logits = responses.score[:, 0]
    cells = weight[:, None, None] * targets.positive
    boxes = decoded(responses.distances, STRIDE)
    iou, giou = overlaps(boxes, corners_of(box)[:, :, None, None])
    losses = {
        "score": own.score * score_loss(logits, targets, weight, own),
        "box": own.box * mean(box_loss(iou, giou, own.kind_of_box), cells),
        "quality": own.quality * mean(cross_entropy(responses.quality[:, 0], iou.detach()), cells),
        "distractor": own.distractor * _distractor_loss(logits, targets, weight * present, own),
    }
    if batch.lessons is not None and settings.teacher is not None:
        losses |= _lesson_losses(logits, boxes, batch.lessons, settings.teacher)
    return losses


def _distractor_loss(
    logits: Tensor, targets: Targets, weight: Tensor, settings: LossSettings
) -> Tensor:
    """By how much the best cell off the target comes too near to the best one on it."""
    on = logits.masked_fill(~targets.positive, -_FAR).amax(dim=(1, 2))
    off = logits.masked_fill(targets.positive | targets.ignored, -_FAR).amax(dim=(1, 2))
    short = (settings.margin + off - on).clamp(min=0)
    return mean(short, weight * targets.positive.any(dim=2).any(dim=1))


def _lesson_losses(
    logits: Tensor, boxes: Tensor, lessons: Lessons, settings: TeacherSettings
) -> dict[str, Tensor]:
    score, theirs, weight = (torch.from_numpy(each) for each in lessons)
    entropy = cross_entropy(logits, score).mean(dim=(1, 2))
    seen = score * (score > _SEES) * weight[:, None, None]
    _, giou = overlaps(boxes, theirs)
    return {
        "teacher_score": settings.score * mean(entropy, weight),
        "teacher_box": settings.box * mean(1 - giou, seen),
    }
