"""The learning rate's way: a linear rise, then half a cosine."""

from __future__ import annotations

import math

from ssiam.training.settings import OptimiserSettings

__all__ = ["rate"]


def rate(step: int, steps: int, settings: OptimiserSettings) -> float:
    """Share of the greatest learning rate in a step, 0..1; a function of the step alone."""
    warm_up = min(settings.warm_up, steps // 10)
    if step < warm_up:
        return (step + 1) / warm_up
    progress = (step - warm_up) / max(steps - warm_up, 1)
    cosine = (1 + math.cos(math.pi * min(progress, 1.0))) / 2
    return settings.final + (1 - settings.final) * cosine
