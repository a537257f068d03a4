"""Transforms fitted to point pairs: least squares (eq. 3), and a robust fit.

The paper prints least squares. It is worse than no stabilization once a twentieth of the frame
moves independently, so the default is a robust fit: the best of many two-point hypotheses, then
reweighted least squares.

Points are complex numbers here, x + iy: a rigid transform is ``q = turn * p + shift`` with
``|turn| = 1``, and its angle is that of `turn`; of a similarity, ``|turn|`` is the zoom.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Points, Transform
from ssiam.motion.models import (
    FREEDOM,
    ModelName,
    map_columns,
    normalized,
    small_transform,
    velocities,
)

FitName: TypeAlias = Literal["robust", "least_squares"]
Complex: TypeAlias = NDArray[np.complex128]
Floats: TypeAlias = NDArray[np.float64]

_HYPOTHESES = 100  # of two points each; at 20 % of inliers one in fifty frames finds none
_ROUNDS = 4  # of reweighting
_FREE_ROUNDS = 6  # the same, for affine and homography
_DAMPING = 1e-9  # keeps collinear points solvable
_MAX_ZOOM = 0.2  # largest change of scale of a hypothesis between two frames


def fit_motion(
    prev_xy: Points,
    cur_xy: Points,
    method: FitName,
    tolerance: float,
    *,
    model: ModelName = "rigid",
) -> tuple[Transform, float]:
    """`cur_from_prev` of point pairs (N, 2), N >= 2, and the share 0..1 of inliers.

    Parameters
    ----------
    prev_xy, cur_xy : (N, 2) float64
        Corresponding points in the two frames, pixels.
    method : {"robust", "least_squares"}
    tolerance : float
        Largest error of an inlier, pixels.
    model : {"rigid", "similarity", "affine", "homography"}
        "rigid" is eq. 3; the others have more degrees of freedom.
    """
    p, q = _complex(prev_xy), _complex(cur_xy)
    if method == "least_squares":
        turn, shift = _least_squares(p, q, np.ones(len(p)), model)
    else:
        turn, shift = _robust(p, q, tolerance, model)
    cur_from_prev = np.array(
        [[turn.real, -turn.imag, shift.real], [turn.imag, turn.real, shift.imag], [0, 0, 1]]
    )
    if model in ("affine", "homography"):
        sigma = tolerance if method == "robust" else np.inf
        cur_from_prev = _refined(cur_from_prev, prev_xy, cur_xy, sigma, model)
    distance = np.hypot(*(map_columns(cur_from_prev, prev_xy.T) - cur_xy.T))
    return cur_from_prev, float((distance <= tolerance).mean())


def _refined(
    cur_from_prev: Transform, prev_xy: Points, cur_xy: Points, sigma: float, model: ModelName
) -> Transform:
    """A similarity refined within a larger model, with Geman-McClure weights of `sigma` px."""
    center, size = prev_xy.mean(axis=0), max(float(np.ptp(prev_xy, axis=0).max()) / 2, 1.0)
    pixel_from_unit = np.array([[size, 0, center[0]], [0, size, center[1]], [0, 0, 1]])
    unit_from_pixel = np.linalg.inv(pixel_from_unit)
    found = unit_from_pixel @ cur_from_prev @ pixel_from_unit
    prev, cur = ((xy - center).T / size for xy in (prev_xy, cur_xy))
    for _ in range(_FREE_ROUNDS):
        mapped = map_columns(found, prev)
        residual = cur - mapped
        weights = 1 / (1 + (residual**2).sum(axis=0) * (size / sigma) ** 2) ** 2
        flow = velocities(mapped, model)
        hessian = np.einsum("iaj,kaj,j->ik", flow, flow, weights)
        hessian += _DAMPING * np.eye(FREEDOM[model]) * weights.sum()
        steps = np.linalg.solve(hessian, np.einsum("iaj,aj,j->i", flow, residual, weights))
        found = normalized(small_transform(steps) @ found, model)
    return np.asarray(pixel_from_unit @ found @ unit_from_pixel, dtype=np.float64)


def _least_squares(
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


def _robust(p: Complex, q: Complex, tolerance: float, model: ModelName) -> tuple[complex, complex]:
    """(turn, shift) of the largest group of pairs that agree within `tolerance` pixels.

    The group is found by two-point hypotheses, which are the same in every call, and refined by
    least squares with Geman-McClure weights of decreasing width.
    """
    turn, shift = _consensus(p, q, tolerance, model)
    for sigma in np.geomspace(tolerance, tolerance / 2, _ROUNDS):
        squared = _squared(turn * p + shift - q)
        turn, shift = _least_squares(p, q, 1 / (1 + squared / sigma**2) ** 2, model)
    return turn, shift


def _consensus(
    p: Complex, q: Complex, tolerance: float, model: ModelName
) -> tuple[complex, complex]:
    """The two-point hypothesis with the largest soft count of inliers.

    The weight of a pair decreases smoothly with its error: on water no two points agree exactly,
    and a hard count would select a group by chance.
    """
    first, second = _pairs(len(p))
    span = p[second] - p[first]
    turn = np.divide(q[second] - q[first], span, out=np.ones_like(span), where=span != 0)
    zoom = np.abs(turn)
    unlikely = (np.abs(zoom - 1) > _MAX_ZOOM) | (model == "rigid")
    turn = np.where(unlikely, np.divide(turn, zoom, out=np.ones_like(turn), where=zoom > 0), turn)
    shift = (q[first] + q[second] - turn * (p[first] + p[second])) / 2
    squared = _squared(turn[:, None] * p + shift[:, None] - q)
    best = int(np.argmax((1 / (1 + squared / tolerance**2)).sum(axis=1)))
    return complex(turn[best]), complex(shift[best])


@lru_cache(maxsize=256)
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of the first and second point of each hypothesis; the two always differ."""
    rng = np.random.default_rng(count)
    first = rng.integers(0, count, _HYPOTHESES)
    second = (first + rng.integers(1, count, _HYPOTHESES)) % count
    return first, second


def _complex(xy: Points) -> Complex:
    return np.asarray(xy @ (1, 1j), dtype=np.complex128)


def _squared(values: Complex) -> Floats:
    return values.real**2 + values.imag**2
