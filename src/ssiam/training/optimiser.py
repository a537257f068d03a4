"""The optimiser: AdamW with a slower backbone, and no decay where it would do harm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from torch import nn
from torch.optim import AdamW

from ssiam.training.lite2_student import Lite2Student
from ssiam.training.mask_student import MaskStudent
from ssiam.training.schedule import rate
from ssiam.training.settings import OptimiserSettings, TrainSettings
from ssiam.training.student import Student

__all__ = ["build_optimiser", "set_rate"]

AnyStudent: TypeAlias = Student | Lite2Student | MaskStudent


def build_optimiser(student: AnyStudent, settings: TrainSettings) -> AdamW:
    """AdamW on all that will ever learn, in groups that know their `factor` of the rate.

    A light stem has none: ImageNet has not taught it.
    """
    own = settings.optimiser
    if not isinstance(student, Student):
        return _optimiser(student.parts(own), own)
    first_trained = settings.network.frozen_levels(settings.network.frozen_steps)
    backbone = student.backbone_weights(first_trained)
    theirs = {id(parameter) for parameter in student.network.backbone.parameters()}
    others = [each for each in student.parameters() if id(each) not in theirs]
    others += student.stem_weights()
    return _optimiser([(backbone, own.backbone), (others, 1.0)], own)


def _optimiser(parts: Sequence[tuple[list[nn.Parameter], float]], own: OptimiserSettings) -> AdamW:
    """AdamW on parts of a network, each with its factor of the rate."""
    groups = [
        {"params": weights, "factor": factor, "weight_decay": decay}
        for parameters, factor in parts
        for weights, decay in zip(_split(parameters), (own.decay, 0.0), strict=True)
        if weights
    ]
    return AdamW(groups, lr=own.lr)


def set_rate(optimiser: AdamW, step: int, settings: TrainSettings) -> float:
    """Set the rate of a step; the one of the groups without a factor is returned.

    It rises and falls once while a light stem learns alone, and once more after that.
    """
    own, alone = settings.optimiser, settings.network.stem_alone
    if step < alone:
        lr = own.stem_lr * rate(step, alone, own)
    else:
        lr = own.lr * rate(step - alone, settings.steps - alone, own)
    for group in optimiser.param_groups:
        group["lr"] = lr * group["factor"]
    return lr


def _split(parameters: list[nn.Parameter]) -> tuple[list[nn.Parameter], list[nn.Parameter]]:
    """Kernels, and all else: biases and normalisations."""
    kernels = [each for each in parameters if each.ndim > 1]
    return kernels, [each for each in parameters if each.ndim <= 1]
