"""`solve_within`: banded least squares with limits, each a squared penalty of its violation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ssiam.render.banded import BandedLeastSquares, Floats

_ROUNDS: Final = 40  # Newton steps; few are needed, since the sum is piecewise quadratic
_HALVINGS: Final = 12  # of a step that does not reduce the sum
_CLOSE: Final = 1e-4  # unknowns: largest step at which the search ends


@dataclass(frozen=True, eq=False)
class Limit:
    """``low <= rows @ unknowns <= high`` in each of N frames.

    Attributes
    ----------
    rows : (N, channels) float64
    low, high : (N,) float64
    weight : (N,) float64
        Of the squared violation.
    """

    rows: Floats
    low: Floats
    high: Floats
    weight: Floats

    def bound(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Violation (N,), and the bound that is violated; 0 where none is."""
        value = (self.rows * unknowns).sum(axis=1)
        bound = np.clip(value, self.low, self.high)
        violation = value - bound
        return violation, np.where(violation != 0, bound, 0.0)


@dataclass(frozen=True)
class StepLimit:
    """The largest absolute difference of each unknown over time.

    Attributes
    ----------
    order : int
        1 limits the speed, 2 the acceleration.
    largest : float
    weight : float
        Of the squared violation.
    """

    order: int
    largest: float
    weight: float

    def bound(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Violation (N - order, channels), and the bound that is violated; 0 where none is."""
        value = np.diff(unknowns, self.order, axis=0)
        bound = np.clip(value, -self.largest, self.largest)
        violation = value - bound
        return violation, np.where(violation != 0, bound, 0.0)


def solve_within(base: BandedLeastSquares, limits: Sequence[Limit | StepLimit]) -> Floats:
    """The unknowns (N, channels) of the smallest sum, with penalties for violated limits."""

    def total(unknowns: Floats) -> float:
        penalties = [np.sum(limit.weight * limit.bound(unknowns)[0] ** 2) for limit in limits]
        return base.increase(unknowns - unlimited) + float(sum(penalties))

    unknowns = unlimited = base.solve()
    least = total(unknowns)
    for _ in range(_ROUNDS):
        problem = base.copy()
        for limit in limits:
            violation, bound = limit.bound(unknowns)
            active = limit.weight * (violation != 0)
            if isinstance(limit, StepLimit):
                problem.add_difference(limit.order, active, bound)
            else:
                problem.add_terms(limit.rows, active, bound)
        step = problem.solve() - unknowns
        for _ in range(_HALVINGS):
            reduced = total(unknowns + step)
            if reduced <= least or np.abs(step).max() <= _CLOSE:
                break
            step = step / 2
        unknowns, least = unknowns + step, reduced
        if np.abs(step).max() <= _CLOSE:
            break
    return unknowns
