"""Transforms fitted to point pairs: least squares (eq. 3), and a robust fit.

The paper prints least squares. It is worse than no stabilization once a twentieth of the frame
moves independently. The default is a robust fit: the best of many two-point hypotheses, then
reweighted least squares.

Points are complex numbers here, x + iy: a rigid transform is ``q = rotation * p + shift`` with
``|rotation| = 1``, and its angle is that of `rotation`. For a similarity, ``|rotation|`` is the
zoom.
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

_HYPOTHESES = 100  # pairs of points; with 20 % inliers, one frame in fifty has no pair of inliers
_ITERATIONS = 4  # of reweighted least squares
_REFINING_ITERATIONS = 6  # of reweighted least squares, for affine and homography
_DAMPING = 1e-9  # added to the diagonal of the Hessian, so that collinear points have a solution
_MAX_ZOOM = 0.2  # largest change of scale of a hypothesis between two frames


def fit_motion(
    prev_xy: Points,
    cur_xy: Points,
    method: FitName,
    tolerance: float,
    *,
    model: ModelName = "rigid",
) -> tuple[Transform, float]:
    """Fit a transform to N >= 2 point pairs.

    Parameters
    ----------
    prev_xy, cur_xy : (N, 2) float64
        Corresponding points in the two frames, pixels.
    method : {"robust", "least_squares"}
    tolerance : float
        Largest error of an inlier, pixels.
    model : {"rigid", "similarity", "affine", "homography"}
        "rigid" is eq. 3; the others have more degrees of freedom.

    Returns
    -------
    cur_from_prev : (3, 3) float64
        Pixels.
    inliers : float
        0..1: share of the pairs with an error of at most `tolerance`.
    """
    p, q = _complex(prev_xy), _complex(cur_xy)
    if method == "least_squares":
        rotation, shift = _least_squares(p, q, np.ones(len(p)), model)
    else:
        rotation, shift = _robust(p, q, tolerance, model)
    a, b = rotation.real, rotation.imag
    cur_from_prev = np.array([[a, -b, shift.real], [b, a, shift.imag], [0, 0, 1]])
    if model in ("affine", "homography"):
        sigma = tolerance if method == "robust" else np.inf
        cur_from_prev = _refined(cur_from_prev, prev_xy, cur_xy, sigma, model)
    distance = np.hypot(*(map_columns(cur_from_prev, prev_xy.T) - cur_xy.T))
    return cur_from_prev, float((distance <= tolerance).mean())


def _refined(
    cur_from_prev: Transform, prev_xy: Points, cur_xy: Points, sigma: float, model: ModelName
) -> Transform:
    """Refine a similarity within a larger model, with Geman-McClure weights of `sigma` px."""
    center, size = prev_xy.mean(axis=0), max(float(np.ptp(prev_xy, axis=0).max()) / 2, 1.0)
    pixel_from_unit = np.array([[size, 0, center[0]], [0, size, center[1]], [0, 0, 1]])
    unit_from_pixel = np.linalg.inv(pixel_from_unit)
    refined = unit_from_pixel @ cur_from_prev @ pixel_from_unit  # units
    prev, cur = ((xy - center).T / size for xy in (prev_xy, cur_xy))
    for _ in range(_REFINING_ITERATIONS):
        mapped = map_columns(refined, prev)
        residual = cur - mapped
        weights = 1 / (1 + (residual**2).sum(axis=0) * (size / sigma) ** 2) ** 2
        flow = velocities(mapped, model)
        hessian = np.einsum("iaj,kaj,j->ik", flow, flow, weights)
        hessian += _DAMPING * np.eye(FREEDOM[model]) * weights.sum()
        steps = np.linalg.solve(hessian, np.einsum("iaj,aj,j->i", flow, residual, weights))
        refined = normalized(small_transform(steps) @ refined, model)
    return np.asarray(pixel_from_unit @ refined @ unit_from_pixel, dtype=np.float64)


def _least_squares(
    p: Complex, q: Complex, weights: Floats, model: ModelName
) -> tuple[complex, complex]:
    """(rotation, shift) that minimize the weighted sum of squared distances (eq. 3)."""
    share = weights / weights.sum()
    p_mean, q_mean = share @ p, share @ q
    from_mean = p - p_mean
    a_id = (share * np.conj(from_mean)) @ (q - q_mean)  # eq. 4: da = arctan(d / a)
    size = abs(a_id) if model == "rigid" else share @ _squared(from_mean)
    rotation = a_id / size if size > 0 else 1 + 0j
    return complex(rotation), complex(q_mean - rotation * p_mean)


def _robust(p: Complex, q: Complex, tolerance: float, model: ModelName) -> tuple[complex, complex]:
    """(rotation, shift) of the largest group of pairs that agree within `tolerance` pixels.

    The group is found by two-point hypotheses, which are the same in every call for the same number
    of pairs, and refined by least squares with Geman-McClure weights of decreasing width.
    """
    rotation, shift = _consensus(p, q, tolerance, model)
    for sigma in np.geomspace(tolerance, tolerance / 2, _ITERATIONS):
        squared = _squared(rotation * p + shift - q)
        rotation, shift = _least_squares(p, q, 1 / (1 + squared / sigma**2) ** 2, model)
    return rotation, shift


def _consensus(
    p: Complex, q: Complex, tolerance: float, model: ModelName
) -> tuple[complex, complex]:
    """The two-point hypothesis with the largest soft count of inliers.

    The weight of a pair decreases smoothly with its error: on water no two points agree exactly,
    and a hard count would select a group by chance.
    """
    first, second = _pairs(len(p))
    span = p[second] - p[first]
    rotation = np.divide(q[second] - q[first], span, out=np.ones_like(span), where=span != 0)
    zoom = np.abs(rotation)
    rigid = np.divide(rotation, zoom, out=np.ones_like(rotation), where=zoom > 0)
    without_zoom = (np.abs(zoom - 1) > _MAX_ZOOM) | (model == "rigid")
    rotation = np.where(without_zoom, rigid, rotation)
    shift = (q[first] + q[second] - rotation * (p[first] + p[second])) / 2
    squared = _squared(rotation[:, None] * p + shift[:, None] - q)
    best = int(np.argmax((1 / (1 + squared / tolerance**2)).sum(axis=1)))
    return complex(rotation[best]), complex(shift[best])


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
