"""AdamW, its learning rate schedule, the weight average, and reuse of freed memory."""

from __future__ import annotations

import copy
import ctypes
import math
import platform
from typing import Final

import torch
from torch import nn
from torch.optim import AdamW

from ssiam.training.settings import OptimizerSettings, TrainSettings
from ssiam.training.students import AnyNetwork, Student

__all__ = [
    "WeightAverage",
    "build_optimizer",
    "keep_freed_memory",
    "learning_rate_factor",
    "set_learning_rate",
]

# Parameters of mallopt (malloc.h): all blocks come from the heap, and its end is never returned.
_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_MAX = -1, -2, -4
_NEVER: Final = 2**31 - 1  # bytes
_HEAP_GROWTH: Final = 2**28  # bytes


def build_optimizer(student: Student, settings: OptimizerSettings) -> AdamW:
    """AdamW on all parameters that any step trains.

    Each parameter group stores its `factor` of the learning rate. Biases and normalizations have
    no weight decay.
    """
    groups = [
        {"params": weights, "factor": factor, "weight_decay": decay}
        for parameters, factor in student.parameter_groups()
        for weights, decay in zip(_split(parameters), (settings.decay, 0.0), strict=True)
        if weights
    ]
    return AdamW(groups, lr=settings.lr)


def _split(parameters: list[nn.Parameter]) -> tuple[list[nn.Parameter], list[nn.Parameter]]:
    """Kernels, and the rest: biases and normalizations."""
    kernels = [each for each in parameters if each.ndim > 1]
    return kernels, [each for each in parameters if each.ndim <= 1]


def set_learning_rate(optimizer: AdamW, step: int, settings: TrainSettings) -> None:
    """Set the learning rate of a step."""
    rates = settings.optimiser
    lr = rates.lr * learning_rate_factor(step, settings.steps, rates)
    for group in optimizer.param_groups:
        group["lr"] = lr * group["factor"]


def learning_rate_factor(step: int, steps: int, settings: OptimizerSettings) -> float:
    """Fraction 0..1 of the maximum learning rate: linear warm-up, then half a cosine."""
    warm_up = min(settings.warm_up, steps // 10)
    if step < warm_up:
        return (step + 1) / warm_up
    progress = (step - warm_up) / max(steps - warm_up, 1)
    cosine = (1 + math.cos(math.pi * min(progress, 1.0))) / 2
    return settings.final + (1 - settings.final) * cosine


class WeightAverage:
    """Exponential moving average of a network's weights.

    Parameters
    ----------
    network : LiteNetwork or BoxMaskNetwork
        With the initial weights.
    decay : float
        Weight of the average in each step. It is smaller in the first steps, so that random
        initial weights lose their influence.

    Attributes
    ----------
    network : LiteNetwork or BoxMaskNetwork
        With the average weights, in evaluation mode.
    """

    def __init__(self, network: AnyNetwork, decay: float) -> None:
        self.network = copy.deepcopy(network).eval().requires_grad_(False)
        self._decay = decay

    def on_cpu(self) -> AnyNetwork:
        """The network on the CPU: itself, or a copy."""
        if next(self.network.parameters()).is_cpu:
            return self.network
        return copy.deepcopy(self.network).cpu()

    @torch.no_grad()
    def update(self, network: AnyNetwork, step: int) -> None:
        """Include the weights after a step, counted from 0."""
        decay = min(self._decay, (1 + step) / (10 + step))
        for average, current in zip(
            self.network.state_dict().values(), network.state_dict().values(), strict=True
        ):
            if average.is_floating_point():
                average.lerp_(current, 1 - decay)
            else:
                average.copy_(current)


def keep_freed_memory() -> None:
    """Make glibc keep freed memory for reuse; no effect with other C libraries.

    The features of large crops are freed and allocated again in every step. Returning them to the
    system costs half of the training time, as it has to clear new pages.
    """
    if platform.libc_ver()[0] != "glibc":
        return
    mallopt = ctypes.CDLL(None).mallopt
    mallopt(_M_MMAP_MAX, 0)
    mallopt(_M_TRIM_THRESHOLD, _NEVER)
    mallopt(_M_TOP_PAD, _HEAP_GROWTH)
