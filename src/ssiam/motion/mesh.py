"""Local motion around the motion of the whole frame: a mesh of shifts.

Where the camera flies past things, near and far background move differently (parallax), and no
single transform describes both. As in bundled camera paths (Liu et al., SIGGRAPH 2013), the frame
is covered by a coarse mesh whose motion is held to the global one and to that of its neighbors.
Here a node has a shift, and all nodes are found together, by the least squares of direct
alignment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image, Transform, map_points
from ssiam.motion.cells import CellTemplate, Floats, Grid

# From benchmarks/motion/parallax.py --chosen
_NODES: Final = 6  # along the longer side
_ROUNDS: Final = 4
_TOLERANCES: Final = (1.0, 0.3)  # share of the texture by which a cell may differ: first, later
_NOISE: Final = 2.0  # gray levels by which a cell without texture may differ
_STIFFNESS: Final = 0.3  # weight of the squared difference, px, of neighboring shifts
_ANCHOR: Final = 0.03  # weight of the squared shift, px: to the global motion
_SOBEL: Final = 1 / 8  # gray levels per pixel for a response of 1 of a 3 × 3 Sobel filter
_MAX_SHIFT: Final = 0.03  # of the longer side; larger local shifts are cut off


@dataclass(frozen=True, eq=False)
class MotionMesh:
    """Shifts of the background on a regular mesh of nodes.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    shifts_xy : (rows, columns, 2) float64
        What is added to a point of the previous frame before the global motion; pixels.
    area_xywh : (x, y, w, h)
        Centers of the outermost nodes, raw-frame pixels.
    """

    shifts_xy: NDArray[np.float64]
    area_xywh: XYWH

    def shift_at(self, point: tuple[float, float]) -> tuple[float, float]:
        """The shift at a point, interpolated between nodes; outside, that of the border."""
        origin, side = np.array(self.area_xywh[:2]), np.array(self.area_xywh[2:])
        (weights,) = _node_weights(((np.array(point) - origin) / side)[None], self.shape)
        x, y = (weights @ self.shifts_xy.reshape(-1, 2)).tolist()
        return x, y

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of nodes."""
        rows, columns, _ = self.shifts_xy.shape
        return rows, columns

    def moved(self, origin_xy: tuple[int, int]) -> MotionMesh:
        """The mesh of whole frames, where this is that of a crop whose corner is `origin_xy`."""
        x, y, w, h = self.area_xywh
        return replace(self, area_xywh=(x + origin_xy[0], y + origin_xy[1], w, h))


class MeshEstimator:
    """Finds the mesh of shifts around a known global motion.

    Parameters
    ----------
    grid : Grid
    frame_from_pixel : (3, 3) float64
        Pixels of the grid's images to pixels of the frame; a scale and a shift.
    """

    def __init__(self, grid: Grid, frame_from_pixel: Transform) -> None:
        self._grid, self._frame_from_pixel = grid, frame_from_pixel
        self._positions = grid.positions.reshape(2, -1).T  # (samples, 2)
        low, high = self._positions[0], self._positions[-1]
        self._area = low, np.maximum(high - low, 1.0)
        across = self._area[1] / self._area[1].max()
        columns, rows = np.maximum(np.rint(_NODES * across), 2).astype(int).tolist()
        self._shape = rows, columns
        centers = grid.cell_means(grid.positions)  # (2, cells)
        self._in_cell = self._weights_at(centers.T)  # (cells, nodes)
        self._in_sample = self._weights_at(self._positions).astype(np.float32)
        self._hold = _stiffness(self._shape)

    def estimate(
        self, prev: Image, cur: Image, cur_from_prev: Transform, background_share: Floats
    ) -> MotionMesh:
        """The mesh between two images (H, W) uint8 of the grid's size.

        Parameters
        ----------
        prev, cur : (H, W) uint8
        cur_from_prev : (3, 3) float64
            The global motion, pixels of these images.
        background_share : (cells,) float32
            Share 0..1 of each cell that is background.
        """
        grid, template = self._grid, CellTemplate(prev, self._grid)
        image = cur.astype(np.float32)
        even = background_share * template.textured / (template.texture + _NOISE**2)
        products = template.products * (_SOBEL**2 / template.values.shape[0])
        nodes = len(self._hold)
        shifts = np.zeros((nodes, 2))
        limit = _MAX_SHIFT * max(image.shape)
        for turn in range(_ROUNDS):
            at = map_points(cur_from_prev, self._positions + self._in_sample @ shifts)
            residual = grid.sampled(image, at) - template.values
            error = grid.mean(np.square(grid.center(residual)))
            tolerance = _TOLERANCES[min(turn, len(_TOLERANCES) - 1)]
            tolerated = _NOISE**2 + tolerance * template.texture
            weight = even * np.square(tolerated / (tolerated + error))
            slopes = np.einsum("kij,ij->kj", template.gradients, residual) * _SOBEL
            slopes *= weight / template.values.shape[0]
            blocks = np.einsum("cn,kc,cm->knm", self._in_cell, products * weight, self._in_cell)
            xx, xy, yy = blocks
            system = np.block([[xx + self._hold, xy], [xy, yy + self._hold]])
            force = (slopes @ self._in_cell + shifts.T @ self._hold).ravel()
            steps = np.linalg.solve(system, force)
            shifts = np.clip(shifts - steps.reshape(2, nodes).T, -limit, limit)
        scale = np.diag(self._frame_from_pixel)[:2]
        origin = self._area[0] * scale + self._frame_from_pixel[:2, 2]
        (x, y), (w, h) = origin.tolist(), (self._area[1] * scale).tolist()
        return MotionMesh((shifts * scale).reshape(*self._shape, 2), (x, y, w, h))

    def _weights_at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights (n, nodes) of the nodes at positions (n, 2), pixels."""
        low, side = self._area
        return _node_weights((positions - low) / side, self._shape)


def _node_weights(shares: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Bilinear weights (n, rows * columns) of nodes at positions (n, 2), 0..1 along x and y."""
    rows, columns = shape
    along = []
    for share, count in zip(np.clip(shares, 0, 1).T, (columns, rows), strict=True):
        distance = np.abs(share[:, None] * (count - 1) - np.arange(count))
        along.append(np.maximum(1 - distance, 0))
    x, y = along
    return np.asarray((y[:, :, None] * x[:, None, :]).reshape(len(shares), -1))


def _stiffness(shape: tuple[int, int]) -> NDArray[np.float64]:
    """Matrix (nodes, nodes) of the squared differences of neighbors, and of the squared shifts."""
    indices = np.arange(shape[0] * shape[1]).reshape(shape)
    matrix = _ANCHOR * np.eye(indices.size)
    pairs = [(indices[:, :-1], indices[:, 1:]), (indices[:-1], indices[1:])]
    for first, second in pairs:
        for one, other in zip(first.ravel(), second.ravel(), strict=True):
            matrix[one, one] += _STIFFNESS
            matrix[other, other] += _STIFFNESS
            matrix[one, other] -= _STIFFNESS
            matrix[other, one] -= _STIFFNESS
    return matrix
