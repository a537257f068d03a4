"""A picture cut into cells that vote: how it is sampled, and what a template knows of each cell.

A cell is 5 × 5 samples, a small Lucas-Kanade patch (eq. 1 and 2). Samples are kept as
(25, cells), so that every sum over a cell runs over the first axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform
from ssiam.motion.models import ModelName, velocities

Floats: TypeAlias = NDArray[np.floating[Any]]  # float32

SAMPLES: Final = 25  # of a cell
_SIDE: Final = 5
_SOBEL: Final = 1 / 8  # of a 3 × 3 Sobel filter's answer is the gradient
_TEXTURED: Final = 1.0  # grey levels squared


class Grid:
    """Where pictures of one size are sampled, every `stride` pixels, and how each cell moves.

    Attributes
    ----------
    shape : (rows, columns) of cells
    cells : int
    centres : (2, cells) float64
        Middle of each cell, units.
    pixels_per_unit : float
    flow : (freedom, 2 * cells) float32
        Pixels along x, then along y, that the middle of each cell moves for a unit step along
        each generator.
    """

    def __init__(
        self, picture_wh: tuple[int, int], pixel_from_unit: Transform, stride: int, model: ModelName
    ) -> None:
        self.model: ModelName = model
        self._stride, self._first = stride, stride // 2
        columns, rows = (((side - 1 - self._first) // stride + 1) // _SIDE for side in picture_wh)
        self.shape, self.cells = (rows, columns), rows * columns
        self._samples_wh = columns * _SIDE, rows * _SIDE
        pixel_from_sample = np.diag([stride, stride, 1.0])
        pixel_from_sample[:2, 2] = self._first
        self._pixel_from_unit = pixel_from_unit
        self._unit_from_sample = np.linalg.inv(pixel_from_unit) @ pixel_from_sample
        scale_xy, first_xy = np.diag(self._unit_from_sample)[:2], self._unit_from_sample[:2, 2]
        middles = [
            scale * (np.arange(count) * _SIDE + _SIDE // 2) + first
            for count, scale, first in zip((columns, rows), scale_xy, first_xy, strict=True)
        ]
        self.centres = np.stack(np.meshgrid(*middles)).reshape(2, -1)
        self._cell_wh = scale_xy * _SIDE
        self._cell_ends = [m + side / 2 for m, side in zip(middles, self._cell_wh, strict=True)]
        self.pixels_per_unit = float(pixel_from_unit[0, 0])
        flow = velocities(self.centres, model) * np.diag(pixel_from_unit)[:2, None] * _SOBEL
        self.flow: Floats = flow.reshape(len(flow), -1).astype(np.float32)
        fx, fy = flow.swapaxes(0, 1)
        products = [_outer(fx, fx), _outer(fx, fy) + _outer(fy, fx), _outer(fy, fy)]
        self._flow_products = [product.astype(np.float32) for product in products]

    def hessians(self, gradients: Floats) -> Floats:
        """Each cell's ``J Jᵀ``, (freedom², cells), from its gradients (2, 25, cells)."""
        gx, gy = gradients
        xx, xy, yy = self._flow_products
        return xx * over_cells(gx, gx) + xy * over_cells(gx, gy) + yy * over_cells(gy, gy)

    def samples(self, picture: NDArray[Any]) -> Floats:
        """Samples (25, cells) of a picture."""
        first, stride = self._first, self._stride
        width, height = self._samples_wh
        sampled = picture[first : first + height * stride : stride]
        return self._by_cell(sampled[:, first : first + width * stride : stride])

    def warped(self, picture: Image, cur_from_prev: Transform) -> Floats:
        """Samples (25, cells) of a picture, each taken where a transform of units sends it."""
        pixel_from_sample = self._pixel_from_unit @ cur_from_prev @ self._unit_from_sample
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        if self.model == "homography":
            seen = cv2.warpPerspective(picture, pixel_from_sample, self._samples_wh, flags=flags)
        else:
            seen = cv2.warpAffine(picture, pixel_from_sample[:2], self._samples_wh, flags=flags)
        return self._by_cell(seen)

    def outside(self, low_xy: Sequence[float], high_xy: Sequence[float]) -> Floats:
        """Share (cells,) of each cell that is outside of an upright box in units."""
        covered = [
            np.maximum(np.minimum(ends, high) - np.maximum(ends - side, low), 0) / side
            for ends, side, low, high in zip(
                self._cell_ends, self._cell_wh, low_xy, high_xy, strict=True
            )
        ]
        share: Floats = 1 - np.outer(covered[1], covered[0]).ravel()
        return share

    def _by_cell(self, samples: NDArray[Any]) -> Floats:
        rows, columns = self.shape
        parts = samples.reshape(rows, _SIDE, columns, _SIDE).transpose(1, 3, 0, 2)
        return parts.astype(np.float32, order="C").reshape(SAMPLES, self.cells)


class Template:
    """A picture's samples and their gradients, cell by cell.

    Gradients are taken relative to their cell's mean, and so are errors: a change of light, which
    shifts all of a cell's grey levels, does not count.

    Attributes
    ----------
    values : (25, cells) float32
        Grey levels.
    gradients : (2, 25, cells) float32
        Along x and y, eight times the grey levels per pixel.
    hessians : (freedom * freedom, cells) float32
        Each cell's ``J Jᵀ``.
    texture : (cells,) float32
        Variance of the samples, grey levels squared.
    textured : (cells,) bool
        Cells that have enough of it to tell anything.
    """

    def __init__(self, picture: Image, grid: Grid) -> None:
        self.grid = grid
        self.values = grid.samples(picture)
        gradients = np.stack([grid.samples(part) for part in cv2.spatialGradient(picture)])
        gradients -= np.add.reduce(gradients, axis=1, keepdims=True) * (1 / SAMPLES)
        self.gradients: Floats = gradients
        self.hessians = grid.hessians(gradients)
        self.texture = variance(self.values)
        self.textured = self.texture > _TEXTURED


def variance(samples: Floats) -> Floats:
    """Mean square (cells,) of samples (25, cells), each cell's mean taken off."""
    mean = np.add.reduce(samples) * (1 / SAMPLES)
    spread: Floats = over_cells(samples, samples) * (1 / SAMPLES) - mean * mean
    return np.maximum(spread, 0, out=spread)


def over_cells(first: Floats, second: Floats) -> Floats:
    """Sum (cells,) of the products of two sets of samples (25, cells)."""
    summed: Floats = np.einsum("ij,ij->j", first, second)
    return summed


def _outer(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Products (freedom * freedom, cells) of all pairs of rows."""
    freedom, cells = first.shape
    return (first[:, None] * second[None]).reshape(freedom * freedom, cells)
