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
CameraModelName: TypeAlias = ModelName | Literal["mesh"]

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
