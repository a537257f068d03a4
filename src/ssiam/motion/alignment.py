"""Robust alignment of an image to the cells of the previous frame.

Inverse compositional Gauss-Newton (Baker and Matthews, 2004), with one robust weight per cell: the
error of a cell relative to its texture decides its weight, so that cells on independently moving
objects do not count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform
from ssiam.motion.cells import AnyTemplate, CellTemplate, CompiledTemplate, Floats
from ssiam.motion.models import normalized, small_transform

# Added to the diagonal of the Hessian, so that an image without texture has a solution
_DAMPING: Final = 1e-6  # share of the first diagonal element
_EPSILON: Final = 1e-9
_MIN_TOLERANCE: Final = 0.05  # share of the texture, which `tightening` does not go below


@dataclass(frozen=True)
class AlignmentSettings:
    """How cells are weighted, and when the iteration ends.

    Parameters
    ----------
    noise : float
        Gray levels by which a cell without texture may differ.
    tolerance : float
        Share of its texture (variance) by which a cell may differ.
    evenness : float
        0 weights a cell by its squared texture, as least squares does; 1 gives all cells equal
        weight.
    max_iterations : int
    min_step : float
        Sum of absolute steps, units, below which the iteration ends.
    tightening : float
        Factor of the tolerance from one iteration to the next, down to 5 % of the texture.
    """

    noise: float
    tolerance: float
    evenness: float
    max_iterations: int
    min_step: float
    tightening: float = 1.0

    def tolerated(self, texture: Floats) -> Floats:
        """Error (cells,), gray levels squared, at which the agreement of a cell is a quarter."""
        return self.noise**2 + self.tolerance * texture

    def tightened(self) -> AlignmentSettings:
        """The settings of the next iteration."""
        return replace(self, tolerance=max(self.tolerance * self.tightening, _MIN_TOLERANCE))


@dataclass(frozen=True, eq=False)
class Alignment:
    """The result of `align`.

    Attributes
    ----------
    cur_from_prev : (3, 3) float64
        Units.
    error : (cells,) float32
        Mean squared difference of each cell, gray levels squared.
    """

    cur_from_prev: Transform
    error: Floats


def align(
    template: AnyTemplate,
    image: Image,
    start: Transform,
    background_share: Floats,
    settings: AlignmentSettings,
) -> Alignment:
    """Find the transform that maps the template to the image, and the error of each cell.

    Parameters
    ----------
    template : CellTemplate or CompiledTemplate
        The template of the previous frame. The compiled one is aligned by the compiled kernel.
    image : (H, W) uint8
        The current frame, at the scale of the template.
    start : (3, 3) float64
        Initial cur_from_prev, units.
    background_share : (cells,) float32
        Share 0..1 of each cell that is background; it scales the weight of the cell.
    settings : AlignmentSettings
    """
    if isinstance(template, CompiledTemplate):
        return Alignment(*template.kernel.align(template, image, start, background_share, settings))
    grid, texture = template.grid, template.texture
    image_f32 = image.astype(np.float32)  # warps faster than uint8, without rounding
    weight = background_share * (texture + settings.noise**2) ** -settings.evenness
    tolerated = settings.tolerated(texture)
    cur_from_prev = start
    for _ in range(settings.max_iterations):
        residual = grid.warped(image_f32, cur_from_prev)
        residual -= template.values
        error = grid.mean(np.square(grid.center(residual)))
        steps = _steps(template, residual, weight * agreement(error, tolerated))
        cur_from_prev = normalized(cur_from_prev.dot(small_transform(-steps)), grid.model)
        if cv2.norm(steps, cv2.NORM_L1) < settings.min_step:
            break
        if settings.tightening < 1:
            settings = settings.tightened()
            tolerated = settings.tolerated(texture)
    return Alignment(cur_from_prev, error)


def agreement(error: Floats, tolerated: Floats) -> Floats:
    """Agreement (cells,) 0..1 of each cell: the Geman-McClure weight of its error."""
    weight: Floats = np.square(tolerated / (tolerated + error))
    return weight


def _steps(template: CellTemplate, residual: Floats, weight: Floats) -> NDArray[np.float64]:
    """Steps (freedom,) along the generators that best explain the residual (samples, cells)."""
    grid = template.grid
    slopes = np.einsum("kij,ij->kj", template.gradients, residual) * weight
    gradient = grid.flow.dot(slopes.ravel()).astype(np.float64)
    freedom = len(gradient)
    hessian = grid.flow_products.dot((template.products * weight).ravel()).astype(np.float64)
    hessian[:: freedom + 1] += _DAMPING * hessian[0] + _EPSILON
    solved, steps = cv2.solve(hessian.reshape(freedom, freedom), gradient[:, None])
    return np.asarray(steps, dtype=np.float64).ravel() if solved else np.zeros(freedom)
