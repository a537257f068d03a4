"""Distillation: losses against teachers, and a light stem's loss against ImageNet features."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.networks.backbones.efficientnet_lite import CHANNELS, STEM_LEVELS, EfficientNetLite0
from ssiam.networks.lite import LiteResponses
from ssiam.networks.pretrained import load_imagenet
from ssiam.runtime import Precision
from ssiam.training.data.batches import SEARCH_CROP, TeacherResponses
from ssiam.training.frozen_levels import FrozenLevels
from ssiam.training.losses import (
    Lite2Predictions,
    cross_entropy,
    decode_boxes,
    iou_and_giou,
    weighted_mean,
)
from ssiam.training.settings import TeacherSettings
from ssiam.training.teachers import NanoTrackResponse

__all__ = [
    "FeatureAdapter",
    "StemDistillation",
    "lite2_distillation_losses",
    "lite_distillation_losses",
]

_TEACHER_CHANNELS: Final = 96
_MIN_SCORE: Final = 0.3  # probability from which a teacher's box counts
_MIN_VARIANCE: Final = 1e-3  # of a channel's features


class FeatureAdapter(nn.Module):
    """A 1 x 1 convolution from features at stride 16 to the teacher's; only used in training."""

    def __init__(self) -> None:
        super().__init__()
        self.projection = nn.Conv2d(CHANNELS[-1], _TEACHER_CHANNELS, 1)

    def forward(self, features: Tensor) -> Tensor:
        """Project features (N, 112, n, n) to (N, 96, n, n)."""
        projected: Tensor = self.projection(features)
        return projected


def lite_distillation_losses(
    teacher: NanoTrackResponse,
    responses: LiteResponses,
    features: tuple[Tensor, Tensor],
    settings: TeacherSettings,
) -> dict[str, Tensor]:
    """Losses of "lite" against NanoTrack v3 by name, multiplied by the weights of the settings.

    Parameters
    ----------
    teacher : NanoTrackResponse
    responses : LiteResponses
        Each cell of the teacher is at the corner of four of these cells, which are averaged.
    features : (N, 96, 8, 8) and (N, 96, 16, 16)
        Adapted features of template and search crop.
    settings : TeacherSettings
    """
    template, search, teacher_score, teacher_boxes = (torch.from_numpy(each) for each in teacher)
    feature_loss = _cosine_loss(features[0], template) / 2 + _cosine_loss(features[1], search) / 2
    logits = _at_teacher_cells(responses.score)[:, 0]
    score_loss = F.binary_cross_entropy_with_logits(logits, teacher_score)
    boxes = _at_teacher_cells(decode_boxes(responses.distances))
    weight = teacher_score * (teacher_score > _MIN_SCORE)
    _, giou = iou_and_giou(boxes, teacher_boxes)
    box_loss = ((1 - giou) * weight).sum() / weight.sum().clamp(min=1)
    return {
        "teacher_features": settings.features * feature_loss,
        "teacher_score": settings.score * score_loss,
        "teacher_box": settings.box * box_loss,
    }


def lite2_distillation_losses(
    teacher: TeacherResponses, predictions: Lite2Predictions, settings: TeacherSettings
) -> dict[str, Tensor]:
    """Losses of "lite2" against its teachers by name, multiplied by the settings' weights."""
    teacher_score, teacher_boxes, weight = (torch.from_numpy(each) for each in teacher)
    entropy = cross_entropy(predictions.score, teacher_score).mean(dim=(1, 2))
    box_weight = teacher_score * (teacher_score > _MIN_SCORE) * weight[:, None, None]
    _, giou = iou_and_giou(predictions.boxes, teacher_boxes)
    return {
        "teacher_score": settings.score * weighted_mean(entropy, weight),
        "teacher_box": settings.box * weighted_mean(1 - giou, box_weight),
    }


def _cosine_loss(features: Tensor, theirs: Tensor) -> Tensor:
    """Mean of 1 - cosine similarity over the cells; it does not depend on the features' scale."""
    return (1 - F.cosine_similarity(features, theirs, dim=1)).mean()


def _at_teacher_cells(maps: Tensor) -> Tensor:
    """Maps (N, C, 32, 32) of "lite" -> (N, C, 15, 15) at the teacher's cells."""
    return F.avg_pool2d(maps[:, :, 1:-1, 1:-1], 2)


class StemDistillation:
    """Loss of a light stem against the features of the ImageNet blocks that it replaces.

    Parameters
    ----------
    weights : Path, optional
        The ImageNet weights; None for those of the installed package.
    threads : int
    precision : {"f32", "bf16"}

    Raises
    ------
    MissingExtraError, WeightsError
        The weights are missing or damaged.
    """

    def __init__(self, weights: Path | None, threads: int, precision: Precision) -> None:
        backbone = EfficientNetLite0().eval()
        load_imagenet(backbone, weights)
        self._blocks = FrozenLevels(backbone, STEM_LEVELS, (SEARCH_CROP,), threads, precision)

    def loss(self, levels: list[Tensor], search: NDArray[np.uint8]) -> Tensor:
        """Fraction of the variance of the blocks' features that `levels` do not explain.

        Averaged over channels and levels.

        Parameters
        ----------
        levels : list of Tensor
            The stem's features of the crops: (N, 24, 64, 64) and (N, 40, 32, 32).
        search : (N, 3, 255, 255) uint8 BGR
        """
        return torch.stack(
            [
                _unexplained(ours.float(), theirs)
                for ours, theirs in zip(levels, self._blocks(search), strict=True)
            ]
        ).mean()


def _unexplained(ours: Tensor, theirs: Tensor) -> Tensor:
    all_cells = (0, 2, 3)
    variance = theirs.var(dim=all_cells).clamp(min=_MIN_VARIANCE)
    return ((ours - theirs).square().mean(dim=all_cells) / variance).mean()
