"""Aligning a picture with a template, cell by cell, against everything that moves by itself.

Inverse compositional Gauss-Newton (Baker and Matthews, 2004), in which every cell has a say of
its own: how far it disagrees, measured against its own texture, decides what it counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform
from ssiam.motion.cells import Floats, Template
from ssiam.motion.models import change, within

_DAMPING = 1e-6  # of the first diagonal element, and
_TINY = 1e-9  # keep a picture without texture solvable
_TIGHTEST = 0.05  # of the texture: the least tolerance


@dataclass(frozen=True)
class Rules:
    """How cells vote.

    Parameters
    ----------
    noise : float
        Grey levels by which a cell may differ without texture.
    tolerance : float
        Share of its texture (variance) by which a cell may differ.
    evenness : float
        0 lets a cell count with its texture squared, as least squares has it; 1 gives every cell
        the same say.
    rounds : int
        At most.
    enough : float
        Steps, in units, below which the rounds end.
    tightening : float
        By which the tolerance shrinks at each round, down to a twentieth of the texture.
    """

    noise: float
    tolerance: float
    evenness: float
    rounds: int
    enough: float
    tightening: float = 1.0

    def tolerated(self, texture: Floats) -> Floats:
        """Error (cells,) at which a cell's agreement has fallen to a quarter."""
        return self.noise**2 + self.tolerance * texture

    def tightened(self) -> Rules:
        """The rules of the next round."""
        return replace(self, tolerance=max(self.tolerance * self.tightening, _TIGHTEST))


@dataclass(frozen=True, eq=False)
class Aligned:
    """What came of an alignment.

    Attributes
    ----------
    cur_from_prev : (3, 3) float64
        Units.
    error : (cells,) float32
        Mean squared difference, grey levels squared.
    """

    cur_from_prev: Transform
    error: Floats


def align(
    template: Template, picture: Image, start: Transform, keep: Floats, rules: Rules
) -> Aligned:
    """The transform that takes the template to the picture, and what each cell says of it.

    Parameters
    ----------
    template : Template
        Of the previous frame.
    picture : (H, W) uint8
        Of this frame, at the template's scale.
    start : (3, 3) float64
        cur_from_prev to begin with, units.
    keep : (cells,) float32
        What each cell may count, 0..1.
    """
    grid, texture = template.grid, template.texture
    floats = picture.astype(np.float32)  # warped sooner than bytes, and not rounded
    say = keep * (texture + rules.noise**2) ** -rules.evenness
    tolerated = rules.tolerated(texture)
    cur_from_prev = start
    for _ in range(rules.rounds):
        residual = grid.warped(floats, cur_from_prev)
        residual -= template.values
        error = grid.variance(residual)
        weight = say * agreement_of(error, tolerated)
        steps = _steps(template, residual, weight)
        cur_from_prev = within(cur_from_prev.dot(change(-steps)), grid.model)
        if cv2.norm(steps, cv2.NORM_L1) < rules.enough:
            break
        if rules.tightening < 1:
            rules = rules.tightened()
            tolerated = rules.tolerated(texture)
    return Aligned(cur_from_prev, error)


def agreement_of(error: Floats, tolerated: Floats) -> Floats:
    """How far cells agree, (cells,) 0..1: the Geman-McClure weight of their error."""
    agreement: Floats = np.square(tolerated / (tolerated + error))
    return agreement


def _steps(template: Template, residual: Floats, weight: Floats) -> NDArray[np.float64]:
    """Steps (freedom,) along the generators that best explain the residual (samples, cells)."""
    grid = template.grid
    slopes = np.einsum("kij,ij->kj", template.gradients, residual) * weight
    gradient = grid.flow.dot(slopes.ravel()).astype(np.float64)
    freedom = len(gradient)
    hessian = grid.flow_products.dot((template.products * weight).ravel()).astype(np.float64)
    hessian[:: freedom + 1] += _DAMPING * hessian[0] + _TINY
    solved, steps = cv2.solve(hessian.reshape(freedom, freedom), gradient[:, None])
    return np.asarray(steps, dtype=np.float64).ravel() if solved else np.zeros(freedom)
