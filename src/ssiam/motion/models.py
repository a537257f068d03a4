"""Motion models: families of transforms, each spanned by a few generators.

A generator is a small change of a transform: ``I + step * generator`` shifts, rotates, zooms, ...
by `step`. Both estimators, keypoints and direct alignment, refine a transform by steps along the
generators. Coordinates are *units*: the frame center is (0, 0) and half of the longer side is 1,
so that a step has a similar effect for each generator.
"""

from __future__ import annotations

import math
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import IDENTITY, Transform

ModelName: TypeAlias = Literal["rigid", "similarity", "affine", "homography"]
CameraModelName: TypeAlias = Literal[ModelName, "mesh"]

FREEDOM: Final[dict[ModelName, int]] = {"rigid": 3, "similarity": 4, "affine": 6, "homography": 8}
"""Degrees of freedom of each model."""

_GENERATORS: Final = np.zeros((8, 3, 3))  # a model uses the first FREEDOM of them
_GENERATORS[0, 0, 2] = 1  # shift along x
_GENERATORS[1, 1, 2] = 1  # shift along y
_GENERATORS[2, 1, 0], _GENERATORS[2, 0, 1] = 1, -1  # rotation
_GENERATORS[3, 0, 0], _GENERATORS[3, 1, 1] = 1, 1  # zoom
_GENERATORS[4, 0, 0], _GENERATORS[4, 1, 1] = 1, -1  # stretch
_GENERATORS[5, 0, 1], _GENERATORS[5, 1, 0] = 1, 1  # shear
_GENERATORS[6, 2, 0] = -1  # tilt about the vertical axis
_GENERATORS[7, 2, 1] = -1  # tilt about the horizontal axis
_FLAT: Final = _GENERATORS.reshape(8, 9)

_ROOTS: Final = 10  # square roots before a series of a matrix
_ROOT_STEPS: Final = 8  # of the iteration to a square root
_SINGULAR: Final = 1e-12  # determinant


def velocities(xy: NDArray[np.float64], model: ModelName) -> NDArray[np.float64]:
    """Velocities (freedom, 2, N) of points (2, N) for a step of 1 along each generator; units."""
    x, y = xy
    one, zero = np.ones_like(x), np.zeros_like(x)
    vx = (one, zero, -y, x, x, y, x * x, x * y)
    vy = (zero, one, x, y, -y, x, x * y, y * y)
    freedom = FREEDOM[model]
    return np.stack([np.stack(pair) for pair in zip(vx[:freedom], vy[:freedom], strict=True)])


def small_transform(steps: NDArray[np.float64]) -> Transform:
    """The first-order transform of small steps (freedom,) along the first generators."""
    transform: Transform = IDENTITY + steps.dot(_FLAT[: len(steps)]).reshape(3, 3)
    return transform


def normalized(to_from_from: Transform, model: ModelName) -> Transform:
    """Restore the form of the model after a small step; changes the array."""
    if model == "rigid":
        (a, b, _), (c, d, _), _ = to_from_from.tolist()
        to_from_from[:2, :2] /= math.sqrt(abs(a * d - b * c))
    elif model == "homography":
        to_from_from /= to_from_from[2, 2]
    return to_from_from


def map_columns(to_from_from: Transform, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map points (2, N), one in each column, by a transform."""
    mapped = to_from_from[:, :2] @ xy + to_from_from[:, 2:]
    return np.asarray(mapped[:2] / mapped[2], dtype=np.float64)


def fractional(to_from_from: Transform, shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fractional powers (N, 3, 3): the transform at constant speed, after shares (N,) of its time.

    The logarithm is that of the tenth square root (Denman and Beavers, 1976), whose series
    converges fast. The result is nan where the transform has no real square root.
    """
    root = to_from_from
    with np.errstate(all="ignore"):
        for _ in range(_ROOTS):
            root = _square_root(root)
        small = root - IDENTITY
        logarithm = 2.0**_ROOTS * (small - small @ small / 2 + small @ small @ small / 3)
        powers = shares[:, None, None] * logarithm / 2.0**_ROOTS
        result = IDENTITY + powers + powers @ powers / 2 + powers @ powers @ powers / 6
        for _ in range(_ROOTS):
            result = result @ result
        normed = result / result[:, 2:, 2:]
    return np.asarray(normed)


def _square_root(matrix: Transform) -> Transform:
    root, inverse = matrix, IDENTITY
    for _ in range(_ROOT_STEPS):
        if not np.isfinite(root).all() or abs(np.linalg.det(root)) < _SINGULAR:
            return np.full((3, 3), np.nan)
        root, inverse = (root + np.linalg.inv(inverse)) / 2, (inverse + np.linalg.inv(root)) / 2
    return np.asarray(root)
