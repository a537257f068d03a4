"""`Confidence`: from what a tracker sees to the probability that its box is right.

Trackers' own scores mean different things, and most stay high on whatever has taken the target's
place. A logistic model turns each one's evidence into the same thing: the probability that the
box overlaps the target by more than half.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.runtime import Tensor

Floats = NDArray[np.float64]

_CORE: Final = 0.8  # of a box's sides: its edges are half background
_LEARNT: Final = 0.05  # weight of one more value in what is usual
_LEARNT_SURELY: Final = 0.2
_UNUSUAL: Final = 0.1  # below the usual
_NOTHING: Final = 0.05  # below the usual still is usual
_MUCH: Final = 0.2  # further below makes no difference


@dataclass(frozen=True)
class Confidence:
    """A logistic model; its numbers come from benchmarks/calibration/confidence.py.

    Attributes
    ----------
    weights : tuple of float
        One for each piece of evidence.
    bias : float
    """

    weights: tuple[float, ...]
    bias: float

    def probability(self, evidence: tuple[float, ...]) -> float:
        """That the box overlaps the target by more than half, 0..1."""
        pairs = zip(self.weights, evidence, strict=True)
        return 0.5 + 0.5 * math.tanh((self.bias + sum(w * e for w, e in pairs)) / 2)


class Usual:
    """What is usual of a number while the target is surely tracked."""

    def __init__(self) -> None:
        self._mean: float | None = None

    def shortfall(self, value: float, sure: bool) -> float:
        """By how much a value is less than usual, 0 or negative: little is nothing, much is much.

        A value far below counts towards what is usual only if something else is `sure` of it.
        """
        if self._mean is None:
            self._mean = value
        below = value - self._mean
        if sure or below > -_UNUSUAL:
            self._mean += (_LEARNT_SURELY if sure else _LEARNT) * below
        return max(min(below + _NOTHING, 0.0), -_MUCH)


def look(features: Tensor, stride: float, box: Floats) -> Floats:
    """What a network sees in a box: the mean (C,) of its features (1, C, n, n), of length 1.

    `box` is cx, cy, w, h in pixels of the crop, from its centre; `stride` pixels lie between
    features.
    """
    side = features.shape[-1]
    at = (np.arange(side) - (side - 1) / 2) * stride
    cx, cy, w, h = box
    rows, columns = _within(at, cy, h, stride), _within(at, cx, w, stride)
    mean = features[0][:, rows, columns].mean(axis=(1, 2), dtype=np.float64)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12))


def _within(at: Floats, centre: float, extent: float, stride: float) -> slice:
    """The features within a box along one axis, at least the nearest one."""
    reach = max(_CORE * extent / 2, stride / 2)
    first = int(np.searchsorted(at, centre - reach))
    last = int(np.searchsorted(at, centre + reach))
    first = min(first, len(at) - 1)
    return slice(first, max(last, first + 1))
