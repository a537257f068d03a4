"""The rigid transform that explains point pairs: least squares (eq. 3), and a robust fit.

Least squares is what the paper prints. It is also worse than doing nothing as soon as a twentieth
of the frame moves by itself, so the default is a robust fit: the best of many two-point
hypotheses, then reweighted least squares.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import Points, Transform, map_points

FitName: TypeAlias = Literal["robust", "least_squares"]

_HYPOTHESES = 200  # of two points each; enough at 15 % of inliers
_ROUNDS = 5  # of reweighting


def fit_rigid(
    prev_xy: Points, cur_xy: Points, method: FitName, tolerance: float
) -> tuple[Transform, float]:
    """Rigid `cur_from_prev` of point pairs (N, 2), N >= 2, and the share 0..1 that agree.

    A pair agrees when the transform takes it to within `tolerance` pixels.
    """
    if method not in get_args(FitName):
        raise ArgumentError(f"unknown fit {method!r}: choose from {', '.join(get_args(FitName))}")
    cur_from_prev = (
        least_squares(prev_xy, cur_xy)
        if method == "least_squares"
        else robust(prev_xy, cur_xy, tolerance)
    )
    agree = _distance(cur_from_prev, prev_xy, cur_xy) <= tolerance
    return cur_from_prev, float(agree.mean())


def least_squares(
    prev_xy: Points, cur_xy: Points, weights: NDArray[np.float64] | None = None
) -> Transform:
    """Rigid `cur_from_prev` with the least sum of squared distances (eq. 3 and 4), weighted."""
    weights = np.ones(len(prev_xy)) if weights is None else weights
    prev_mean = np.average(prev_xy, axis=0, weights=weights)
    cur_mean = np.average(cur_xy, axis=0, weights=weights)
    p, q = prev_xy - prev_mean, cur_xy - cur_mean
    a = weights @ (p * q).sum(axis=1)
    d = weights @ (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
    norm = np.hypot(a, d)
    cos, sin = (a / norm, d / norm) if norm > 0 else (1.0, 0.0)  # da = arctan(d / a)
    c, f = cur_mean - (
        cos * prev_mean[0] - sin * prev_mean[1],
        sin * prev_mean[0] + cos * prev_mean[1],
    )
    return np.array([[cos, -sin, c], [sin, cos, f], [0.0, 0.0, 1.0]])


def robust(prev_xy: Points, cur_xy: Points, tolerance: float) -> Transform:
    """Rigid `cur_from_prev` of the largest group of pairs that agree within `tolerance` pixels.

    The group is found by two-point hypotheses (the same ones at every call, so results repeat),
    then refined by least squares under Geman-McClure weights.
    """
    cur_from_prev = least_squares(prev_xy, cur_xy, _consensus(prev_xy, cur_xy, tolerance))
    for _ in range(_ROUNDS):
        squared = _distance(cur_from_prev, prev_xy, cur_xy) ** 2
        weights = (tolerance**2 / (tolerance**2 + squared)) ** 2
        cur_from_prev = least_squares(prev_xy, cur_xy, weights)
    return cur_from_prev


def _consensus(prev_xy: Points, cur_xy: Points, tolerance: float) -> NDArray[np.float64]:
    """Weights 1 for the pairs that agree with the best two-point hypothesis, 0 for the rest.

    Where not even its own two points agree with it (they moved apart), all weights are 1.
    """
    first, second = _pairs(len(prev_xy))
    p = prev_xy[:, 0] + 1j * prev_xy[:, 1]  # a rotation is a product of complex numbers
    q = cur_xy[:, 0] + 1j * cur_xy[:, 1]
    turn = (q[second] - q[first]) * np.conj(p[second] - p[first])
    size = np.abs(turn)
    turn = np.where(size > 0, turn / np.where(size > 0, size, 1), 1)
    shift = (q[first] + q[second] - turn * (p[first] + p[second])) / 2
    squared = np.abs(turn[:, None] * p + shift[:, None] - q) ** 2
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


def _distance(cur_from_prev: Transform, prev_xy: Points, cur_xy: Points) -> NDArray[np.float64]:
    difference = map_points(cur_from_prev, prev_xy) - cur_xy
    return np.asarray(np.hypot(difference[:, 0], difference[:, 1]))
