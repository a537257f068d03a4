"""Aligning a picture with a template, cell by cell, against everything that moves by itself.

Inverse compositional Gauss-Newton (Baker and Matthews, 2004), in which every cell has a say of
its own: how far it disagrees, measured against its own texture, decides what it counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform
from ssiam.motion.cells import Floats, Template, variance
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


@dataclass(frozen=True, eq=False)
class Aligned:
    """What came of an alignment.

    Attributes
    ----------
    cur_from_prev : (3, 3) float64
        Units.
    error : (cells,) float32
        Mean squared difference, grey levels squared.
    agreement : (cells,) float32
        0..1, by the rules' tolerance.
    """

    cur_from_prev: Transform
    error: Floats
    agreement: Floats


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
    say = keep * (texture + rules.noise**2) ** -rules.evenness
    tolerance = rules.tolerance
    cur_from_prev = start
    for _ in range(rules.rounds):
        residual = grid.warped(picture, cur_from_prev) - template.values
        error = variance(residual)
        weight = say * agreement_of(error, texture, rules.noise, tolerance)
        steps = _steps(template, residual, weight)
        cur_from_prev = within(cur_from_prev @ change(-steps), grid.model)
        if np.abs(steps).sum() < rules.enough:
            break
        tolerance = max(tolerance * rules.tightening, _TIGHTEST)
    agreement = agreement_of(error, texture, rules.noise, rules.tolerance)
    return Aligned(cur_from_prev, error, agreement)


def agreement_of(error: Floats, texture: Floats, noise: float, tolerance: float) -> Floats:
    """How far cells agree, (cells,) 0..1: the Geman-McClure weight of their error."""
    scale = noise**2 + tolerance * texture
    agreement: Floats = np.square(scale / (scale + error))
    return agreement


def _steps(template: Template, residual: Floats, weight: Floats) -> NDArray[np.float64]:
    """Steps (freedom,) along the generators that best explain the residual (samples, cells)."""
    slopes = np.einsum("kij,ij->kj", template.gradients, residual) * weight
    gradient = template.grid.flow @ slopes.ravel()
    freedom = len(gradient)
    hessian = (template.hessians @ weight).reshape(freedom, freedom).astype(np.float64)
    hessian.flat[:: freedom + 1] += _DAMPING * hessian[0, 0] + _TINY
    return np.asarray(np.linalg.solve(hessian, gradient), dtype=np.float64)
