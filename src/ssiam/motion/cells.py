"""Cells of an image: how it is sampled, and the gradients and texture of each cell.

A cell is a square of samples, a small Lucas-Kanade patch (eq. 1 and 2). Arrays of samples are
(samples, cells), so that every sum over a cell runs over the first axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform
from ssiam.motion import kernel
from ssiam.motion.kernel import GridKernel, GridLayout, TemplateKernel
from ssiam.motion.models import ModelName, velocities

Floats: TypeAlias = NDArray[np.floating[Any]]  # float32

_SOBEL: Final = 1 / 8  # gray levels per pixel for a response of 1 of a 3 × 3 Sobel filter
_MIN_TEXTURE: Final = 1.0  # gray levels squared
_MIN_BACKGROUND: Final = 0.5  # share of a cell; cells with less are not used


class Grid:
    """Sample positions in images of one size, and the motion of each cell.

    Parameters
    ----------
    image_wh : (int, int)
        Width and height of the images, pixels.
    pixel_from_unit : (3, 3) float64
        Units to pixels of these images; a scale and a shift.
    stride : int
        Pixels between samples.
    side : int
        Samples along each side of a cell.
    model : {"rigid", "similarity", "affine", "homography"}

    Attributes
    ----------
    shape : (rows, columns) of cells
    cells : int
    centers : (2, cells) float64
        Center of each cell, units.
    pixels_per_unit : float
    flow : (freedom, 2 * cells) float32
        Eighths of a pixel along x, then along y, that the center of each cell moves for a unit
        step along each generator: the gradients of `CellTemplate` are eight times too large.
    flow_products : (freedom * freedom, 3 * cells) float32
        Products of `flow` for all pairs of generators: xx, xy + yx, yy.
    """

    def __init__(
        self,
        image_wh: tuple[int, int],
        pixel_from_unit: Transform,
        stride: int,
        side: int,
        model: ModelName,
    ) -> None:
        self.model: ModelName = model
        self._stride, self._first, self._side = stride, stride // 2, side
        columns, rows = (((length - 1 - self._first) // stride + 1) // side for length in image_wh)
        self.shape, self.cells = (rows, columns), rows * columns
        self._samples_wh = columns * side, rows * side
        self._mean_weights = np.full(side**2, 1 / side**2, dtype=np.float32)
        pixel_from_sample = np.diag([stride, stride, 1.0])
        pixel_from_sample[:2, 2] = self._first
        self._pixel_from_unit = pixel_from_unit
        self._unit_from_sample = np.linalg.inv(pixel_from_unit) @ pixel_from_sample
        scale_xy, first_xy = np.diag(self._unit_from_sample)[:2], self._unit_from_sample[:2, 2]
        cell_centers = [
            scale * (np.arange(count) * side + side // 2) + first
            for count, scale, first in zip((columns, rows), scale_xy, first_xy, strict=True)
        ]
        self.centers = np.stack(np.meshgrid(*cell_centers)).reshape(2, -1)
        self._cell_wh = scale_xy * side
        self._cell_ends = [
            center + side / 2 for center, side in zip(cell_centers, self._cell_wh, strict=True)
        ]
        self.pixels_per_unit = float(pixel_from_unit[0, 0])
        flow = velocities(self.centers, model) * np.diag(pixel_from_unit)[:2, None] * _SOBEL
        self.flow: Floats = flow.reshape(len(flow), -1).astype(np.float32)
        fx, fy = flow.swapaxes(0, 1)
        products = [_outer(fx, fx), _outer(fx, fy) + _outer(fy, fx), _outer(fy, fy)]
        self.flow_products: Floats = np.concatenate(products, axis=1).astype(np.float32)
        layout = GridLayout(image_wh, stride, self._first, side, self.shape)
        self.kernel: GridKernel | None = None
        if kernel.is_used() and layout.fits:
            self.kernel = GridKernel(
                layout, pixel_from_unit, np.asarray(self._unit_from_sample, np.float64), self.flow
            )

    def template(self, image: Image, reuse: AnyTemplate | None = None) -> AnyTemplate:
        """The template of an image (H, W) uint8; `reuse` is one that is not needed any more."""
        if self.kernel is None:
            return CellTemplate(image, self)
        template = reuse if isinstance(reuse, CompiledTemplate) else CompiledTemplate(self.kernel)
        template.fill(image)
        return template

    def samples(self, images: Sequence[NDArray[Any]]) -> Floats:
        """Samples (images, samples, cells) of several images."""
        first, stride = self._first, self._stride
        width, height = self._samples_wh
        rows = slice(first, first + height * stride, stride)
        columns = slice(first, first + width * stride, stride)
        side = self._side
        sampled = np.empty((len(images), side, side, *self.shape), dtype=np.float32)
        for image, out in zip(images, sampled, strict=True):
            out[...] = self._by_cell(image[rows, columns])
        return sampled.reshape(len(images), side * side, self.cells)

    def warped(self, image: Floats, cur_from_prev: Transform) -> Floats:
        """Samples (samples, cells) of an image at the positions mapped by a transform of units."""
        pixel_from_sample = self._pixel_from_unit.dot(cur_from_prev).dot(self._unit_from_sample)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        if self.model == "homography":
            warped = cv2.warpPerspective(image, pixel_from_sample, self._samples_wh, flags=flags)
        else:
            warped = cv2.warpAffine(image, pixel_from_sample[:2], self._samples_wh, flags=flags)
        return self._by_cell(warped).reshape(self._side**2, self.cells)

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions (2, rows * side, columns * side) of the samples, pixels of the image."""
        width, height = self._samples_wh
        x, y = (self._first + self._stride * np.arange(count) for count in (width, height))
        return np.asarray(np.meshgrid(x, y), dtype=np.float64)

    def sampled(self, image: Floats, positions_xy: NDArray[np.float64]) -> Floats:
        """Samples (samples, cells) of an image at positions, which are in the image's row order.

        Positions are (rows * side * columns * side, 2), pixels of the image.
        """
        width, height = self._samples_wh
        x, y = positions_xy.T.reshape(2, height, width).astype(np.float32)
        return self._by_cell(cv2.remap(image, x, y, cv2.INTER_LINEAR)).reshape(-1, self.cells)

    def cell_means(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Means (n, cells) over each cell of images of samples (n, rows * side, columns * side)."""
        by_cell = [self._by_cell(each).reshape(-1, self.cells).mean(axis=0) for each in samples]
        return np.array(by_cell)

    def background_share(self, boxes: NDArray[np.float64]) -> Floats:
        """Share (cells,) of each cell outside the boxes (N, 4); 0 if it is less than half.

        Boxes are low x, low y, high x, high y in units.
        """
        share = np.ones(self.cells, dtype=np.float32)
        for low_x, low_y, high_x, high_y in boxes.tolist():
            covered_x = self._covered(0, low_x, high_x)
            share *= 1 - np.outer(self._covered(1, low_y, high_y), covered_x).ravel()
        if len(boxes):
            share[share < _MIN_BACKGROUND] = 0
        return share

    def mask_share(self, mask: Image) -> Floats:
        """Share (cells,) of each cell in which a mask (H, W) of 0 and 255 is set."""
        return self.mean(self.samples([mask])[0]) / 255

    def mean(self, samples: Floats) -> Floats:
        """Mean (..., cells) over each cell of samples (..., samples, cells)."""
        mean: Floats = np.matmul(self._mean_weights, samples)  # three times as fast as np.mean
        return mean

    def center(self, samples: Floats) -> Floats:
        """Subtract the mean of each cell from samples (..., samples, cells), in place."""
        samples -= self.mean(samples)[..., None, :]
        return samples

    def _covered(self, axis: int, low: float, high: float) -> Floats:
        """Share of each column (axis 0) or row (1) of cells between two coordinates, units."""
        ends, side = self._cell_ends[axis], self._cell_wh[axis]
        overlap = np.minimum(ends, high) - np.maximum(ends - side, low)
        return np.asarray(np.maximum(overlap, 0) / side, dtype=np.float32)

    def _by_cell(self, samples: NDArray[Any]) -> NDArray[Any]:
        """A view (side, side, rows, columns) of an image of samples."""
        (rows, columns), side = self.shape, self._side
        return samples.reshape(rows, side, columns, side).transpose(1, 3, 0, 2)


class CellTemplate:
    """Samples and gradients of an image, by cell.

    All values, and so all errors, are relative to the mean of their cell: a change of brightness,
    which shifts all gray levels of a cell, has no effect.

    Parameters
    ----------
    image : (H, W) uint8
    grid : Grid
        Of images of this size.

    Attributes
    ----------
    values : (samples, cells) float32
        Gray levels minus the mean of their cell.
    gradients : (2, samples, cells) float32
        Sobel responses along x and y: eight times the gray levels per pixel.
    products : (3, cells) float32
        Sums over each cell of the gradients' products: xx, xy, yy.
    texture : (cells,) float32
        Variance of the samples, gray levels squared.
    textured : (cells,) bool
        Whether a cell has enough texture for an estimate.
    """

    def __init__(self, image: Image, grid: Grid) -> None:
        self.grid = grid
        samples = grid.samples([*cv2.spatialGradient(image), image])
        grid.center(samples)
        self.gradients, self.values = samples[:2], samples[2]
        xx, yy, squares = np.einsum("kij,kij->kj", samples, samples)
        xy = np.einsum("ij,ij->j", samples[0], samples[1])
        self.products: Floats = np.array([xx, xy, yy])
        self.texture: Floats = squares * (1 / samples.shape[1])
        self.textured = self.texture > _MIN_TEXTURE

    def change_to(self, later: Any) -> Floats:
        """Mean squared change (cells,) to the same cells of a later image, gray levels squared."""
        return self.grid.mean(np.square(later.values - self.values))


class CompiledTemplate(TemplateKernel):
    """A `CellTemplate` that the compiled kernel has made.

    Attributes
    ----------
    texture, textured
        As in `CellTemplate`.
    """

    def fill(self, image: Image) -> None:
        """Compute the template of an image (H, W) uint8."""
        super().fill(image)
        self.textured = self.texture > _MIN_TEXTURE


AnyTemplate: TypeAlias = CellTemplate | CompiledTemplate


def _outer(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Products (freedom * freedom, cells) of all pairs of rows (freedom, cells)."""
    freedom, cells = first.shape
    return (first[:, None] * second[None]).reshape(freedom * freedom, cells)
