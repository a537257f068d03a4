"""The rigid transform that explains point pairs: least squares (eq. 3), and a robust fit.

Least squares is what the paper prints. It is also worse than doing nothing as soon as a twentieth
of the frame moves by itself, so the default is a robust fit: the best of many two-point
hypotheses, then reweighted least squares.

Points are complex numbers here, x + iy: a rigid transform is ``q = turn * p + shift`` with
``|turn| = 1``, and its angle is that of `turn`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import Points, Transform

FitName: TypeAlias = Literal["robust", "least_squares"]
Complex: TypeAlias = NDArray[np.complex128]
Floats: TypeAlias = NDArray[np.float64]

_HYPOTHESES = 100  # of two points each; at 20 % of inliers one in fifty frames finds none
_ROUNDS = 3  # of reweighting


def fit_rigid(
    prev_xy: Points, cur_xy: Points, method: FitName, tolerance: float
) -> tuple[Transform, float]:
    """Rigid `cur_from_prev` of point pairs (N, 2), N >= 2, and the share 0..1 that agree.

    A pair agrees when the transform takes it to within `tolerance` pixels.
    """
    if method not in get_args(FitName):
        raise ArgumentError(f"unknown fit {method!r}: choose from {', '.join(get_args(FitName))}")
    p, q = _complex(prev_xy), _complex(cur_xy)
    if method == "least_squares":
        turn, shift = least_squares(p, q, np.ones(len(p)))
    else:
        turn, shift = robust(p, q, tolerance)
    cur_from_prev = np.array(
        [[turn.real, -turn.imag, shift.real], [turn.imag, turn.real, shift.imag], [0, 0, 1]]
    )
    agree = np.abs(turn * p + shift - q) <= tolerance
    return cur_from_prev, float(agree.mean())


def least_squares(p: Complex, q: Complex, weights: Floats) -> tuple[complex, complex]:
    """(turn, shift) with the least weighted sum of squared distances (eq. 3)."""
    share = weights / weights.sum()
    p_mean, q_mean = share @ p, share @ q
    a_id = (share * np.conj(p - p_mean)) @ (q - q_mean)  # eq. 4: da = arctan(d / a)
    turn = a_id / abs(a_id) if a_id != 0 else 1 + 0j
    return complex(turn), complex(q_mean - turn * p_mean)


def robust(p: Complex, q: Complex, tolerance: float) -> tuple[complex, complex]:
    """(turn, shift) of the largest group of pairs that agree within `tolerance` pixels.

    The group is found by two-point hypotheses (the same ones at every call, so results repeat),
    then refined by least squares under Geman-McClure weights.
    """
    turn, shift = least_squares(p, q, _consensus(p, q, tolerance))
    for _ in range(_ROUNDS):
        squared = _squared(turn * p + shift - q)
        turn, shift = least_squares(p, q, (tolerance**2 / (tolerance**2 + squared)) ** 2)
    return turn, shift


def _consensus(p: Complex, q: Complex, tolerance: float) -> Floats:
    """Weights 1 for the pairs that agree with the best two-point hypothesis, 0 for the rest.

    Where not even its own two points agree with it (they moved apart), all weights are 1.
    """
    first, second = _pairs(len(p))
    turn = (q[second] - q[first]) * np.conj(p[second] - p[first])
    size = np.abs(turn)
    turn = np.divide(turn, size, out=np.ones_like(turn), where=size > 0)
    shift = (q[first] + q[second] - turn * (p[first] + p[second])) / 2
    squared = _squared(turn[:, None] * p + shift[:, None] - q)
    # Points beyond the tolerance all cost the same: the sum ranks equal counts by closeness.
    cost = np.minimum(squared, tolerance**2).sum(axis=1)
    agree = squared[np.argmin(cost)] <= tolerance**2
    return np.asarray(agree if agree.any() else np.ones(len(p)), dtype=np.float64)


@lru_cache(maxsize=256)
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of the first and second point of every hypothesis; never the same point twice."""
    rng = np.random.default_rng(count)
    first = rng.integers(0, count, _HYPOTHESES)
    second = (first + rng.integers(1, count, _HYPOTHESES)) % count
    return first, second


def _complex(xy: Points) -> Complex:
    return np.asarray(xy @ (1, 1j), dtype=np.complex128)


def _squared(values: Complex) -> Floats:
    return values.real**2 + values.imag**2
