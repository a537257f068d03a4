"""A picture cut into cells that vote: how it is sampled, and what a template knows of each cell.

A cell is 5 × 5 samples, a small Lucas-Kanade patch (eq. 1 and 2). Samples are kept as
(25, cells), so that every sum over a cell runs over the first axis.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform
from ssiam.motion.models import FREEDOM, ModelName, velocities

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
    flow : (freedom, 2, cells) float32
        Pixels that the middle of each cell moves for a unit step along each generator.
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
        self._x, self._y = (
            scale * (np.arange(count) * _SIDE + _SIDE // 2) + offset
            for count, scale, offset in zip(
                (columns, rows),
                np.diag(self._unit_from_sample),
                self._unit_from_sample[:2, 2],
                strict=False,
            )
        )
        self.centres = np.stack(np.meshgrid(self._x, self._y)).reshape(2, -1)
        self.pixels_per_unit = float(pixel_from_unit[0, 0])
        flow = velocities(self.centres, model) * np.diag(pixel_from_unit)[:2, None] * _SOBEL
        self.flow: Floats = flow.astype(np.float32)
        self.upper = first, second = np.triu_indices(FREEDOM[model])
        (fx, fy), (sx, sy) = flow[first].swapaxes(0, 1), flow[second].swapaxes(0, 1)
        products = np.stack([fx * sx, fx * sy + fy * sx, fy * sy])
        self.flow_products: Floats = products.astype(np.float32)

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

    def outside(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> Floats:
        """Share (cells,) of each cell that is outside of the upright box from `low` to `high`."""
        covered = []
        for middle, per_sample, least, most in zip(
            (self._x, self._y), np.diag(self._unit_from_sample), low, high, strict=False
        ):
            half = per_sample * _SIDE / 2
            overlap = np.minimum(middle + half, most) - np.maximum(middle - half, least)
            covered.append(np.maximum(overlap, 0) / (2 * half))
        share: Floats = 1 - np.outer(covered[1], covered[0]).ravel().astype(np.float32)
        return share

    def _by_cell(self, samples: NDArray[Any]) -> Floats:
        rows, columns = self.shape
        parts = samples.reshape(rows, _SIDE, columns, _SIDE).transpose(1, 3, 0, 2)
        return parts.astype(np.float32, order="C").reshape(SAMPLES, self.cells)


class Template:
    """A picture's samples and their gradients, cell by cell.

    All are taken relative to the cell's mean, so that changes of light do not count.

    Attributes
    ----------
    values, gx, gy : (25, cells) float32
        Grey levels, and grey levels per pixel.
    hessians : (freedom * (freedom + 1) / 2, cells) float32
        Upper triangle of each cell's ``J Jᵀ``.
    texture : (cells,) float32
        Variance of the samples, grey levels squared.
    textured : (cells,) bool
        Cells that have enough of it to tell anything.
    """

    def __init__(self, picture: Image, grid: Grid) -> None:
        self.grid = grid
        gx, gy = cv2.spatialGradient(picture)
        self.values = centred(grid.samples(picture))
        self.gx, self.gy = (centred(grid.samples(part)) for part in (gx, gy))
        xx, xy, yy = grid.flow_products
        self.hessians = xx * over_cells(self.gx, self.gx)
        self.hessians += xy * over_cells(self.gx, self.gy)
        self.hessians += yy * over_cells(self.gy, self.gy)
        self.texture = over_cells(self.values, self.values) / SAMPLES
        self.textured = self.texture > _TEXTURED


def centred(samples: Floats) -> Floats:
    """Samples (25, cells) less the mean of their cell."""
    samples -= np.add.reduce(samples) * np.float32(1 / SAMPLES)
    return samples


def over_cells(first: Floats, second: Floats) -> Floats:
    """Sum (cells,) of the products of two sets of samples (25, cells)."""
    return np.asarray(np.einsum("ij,ij->j", first, second), dtype=np.float32)
