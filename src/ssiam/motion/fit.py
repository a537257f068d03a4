"""The transform that explains point pairs: least squares (eq. 3), and a robust fit.

Least squares is what the paper prints. It is also worse than doing nothing as soon as a twentieth
of the frame moves by itself, so the default is a robust fit: the best of many two-point
hypotheses, then reweighted least squares.

Points are complex numbers here, x + iy: a rigid transform is ``q = turn * p + shift`` with
``|turn| = 1``, and its angle is that of `turn`; a similarity has a zoom, ``|turn|``, as well.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import check_choice
from ssiam.geometry import Points, Transform

FitName: TypeAlias = Literal["robust", "least_squares"]
ModelName: TypeAlias = Literal["rigid", "similarity"]
Complex: TypeAlias = NDArray[np.complex128]
Floats: TypeAlias = NDArray[np.float64]

_HYPOTHESES = 100  # of two points each; at 20 % of inliers one in fifty frames finds none
_ROUNDS = 4  # of reweighting
_MAX_ZOOM = 0.2  # between two frames, by which a hypothesis may grow or shrink


def fit_motion(
    prev_xy: Points,
    cur_xy: Points,
    method: FitName,
    tolerance: float,
    *,
    model: ModelName = "rigid",
    trust: Floats | None = None,
) -> tuple[Transform, float]:
    """`cur_from_prev` of point pairs (N, 2), N >= 2, and the share 0..1 that agree.

    A pair agrees when the transform takes it to within `tolerance` pixels; `trust` (N,) weighs
    the pairs. The rigid model (eq. 3) turns and shifts, the similarity also zooms.
    """
    check_choice("fit", method, get_args(FitName))
    check_choice("model", model, get_args(ModelName))
    p, q = _complex(prev_xy), _complex(cur_xy)
    trust = np.ones(len(p)) if trust is None else trust
    if method == "least_squares":
        turn, shift = least_squares(p, q, trust, model)
    else:
        turn, shift = robust(p, q, trust, tolerance, model)
    cur_from_prev = np.array(
        [[turn.real, -turn.imag, shift.real], [turn.imag, turn.real, shift.imag], [0, 0, 1]]
    )
    agree = np.abs(turn * p + shift - q) <= tolerance
    return cur_from_prev, float(trust @ agree / trust.sum())


def least_squares(
    p: Complex, q: Complex, weights: Floats, model: ModelName
) -> tuple[complex, complex]:
    """(turn, shift) with the least weighted sum of squared distances (eq. 3)."""
    share = weights / weights.sum()
    p_mean, q_mean = share @ p, share @ q
    from_mean = p - p_mean
    a_id = (share * np.conj(from_mean)) @ (q - q_mean)  # eq. 4: da = arctan(d / a)
    size = abs(a_id) if model == "rigid" else share @ _squared(from_mean)
    turn = a_id / size if size > 0 else 1 + 0j
    return complex(turn), complex(q_mean - turn * p_mean)


def robust(
    p: Complex, q: Complex, trust: Floats, tolerance: float, model: ModelName
) -> tuple[complex, complex]:
    """(turn, shift) of the largest group of pairs that agree within `tolerance` pixels.

    The group is found by two-point hypotheses (the same ones at every call, so results repeat),
    then refined by least squares under Geman-McClure weights that grow stricter.
    """
    turn, shift = _consensus(p, q, trust, tolerance, model)
    for sigma in np.geomspace(tolerance, tolerance / 2, _ROUNDS):
        squared = _squared(turn * p + shift - q)
        turn, shift = least_squares(p, q, trust / (1 + squared / sigma**2) ** 2, model)
    return turn, shift


def _consensus(
    p: Complex, q: Complex, trust: Floats, tolerance: float, model: ModelName
) -> tuple[complex, complex]:
    """The two-point hypothesis that most pairs come near to.

    Nearness fades instead of ending at the tolerance: on water no two points agree exactly, and
    a hard count would pick a group by chance.
    """
    first, second = _pairs(len(p))
    span = p[second] - p[first]
    turn = np.divide(q[second] - q[first], span, out=np.ones_like(span), where=span != 0)
    zoom = np.abs(turn)
    unlikely = (np.abs(zoom - 1) > _MAX_ZOOM) | (model == "rigid")
    turn = np.where(unlikely, np.divide(turn, zoom, out=np.ones_like(turn), where=zoom > 0), turn)
    shift = (q[first] + q[second] - turn * (p[first] + p[second])) / 2
    squared = _squared(turn[:, None] * p + shift[:, None] - q)
    best = int(np.argmax((trust / (1 + squared / tolerance**2)).sum(axis=1)))
    return complex(turn[best]), complex(shift[best])


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
