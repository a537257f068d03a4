"""Least squares over a whole clip: differences and linear terms of neighboring unknowns.

The normal equations are banded, so time and memory grow linearly with the length of the clip.
"""

from __future__ import annotations

from math import comb
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats: TypeAlias = NDArray[np.float64]

_BLOCK: Final = 32  # unknowns per block of the elimination: dense solves of this size are fastest


class BandedLeastSquares:
    """A sum of squares of linear terms in `frames` times `channels` unknowns.

    Parameters
    ----------
    frames : int
    channels : int
        Unknowns per frame, such as x and y.
    max_order : int
        Highest order of a difference over time.
    """

    def __init__(self, frames: int, channels: int, max_order: int = 3) -> None:
        self._frames, self._channels, self._max_order = frames, channels, max_order
        width = max_order * channels + channels
        # bands[d, i] is the element of the normal matrix in row i + d and column i
        self._bands = np.zeros((width, frames * channels))
        self._rhs = np.zeros(frames * channels)

    def copy(self) -> BandedLeastSquares:
        """The same sum, to which other terms can be added."""
        copied = BandedLeastSquares(self._frames, self._channels, self._max_order)
        copied._bands, copied._rhs = self._bands.copy(), self._rhs.copy()
        return copied

    def add_difference(self, order: int, weight: ArrayLike, target: ArrayLike = 0.0) -> None:
        """Add ``weight * (difference - target)**2`` for each difference over time.

        Parameters
        ----------
        order : int
            0 for the unknowns themselves.
        weight, target : array broadcast to (frames - order, channels)
        """
        count = self._frames - order
        if count <= 0:
            return
        step = self._channels
        shape = count, self._channels
        weights = np.broadcast_to(np.asarray(weight, np.float64), shape).ravel()
        targets = np.broadcast_to(np.asarray(target, np.float64), shape).ravel()
        signs = [(-1) ** (order - j) * comb(order, j) for j in range(order + 1)]
        size = count * step
        for low, first in enumerate(signs):
            self._rhs[low * step : low * step + size] += weights * first * targets
            for high in range(low, order + 1):
                band = self._bands[(high - low) * step]
                band[low * step : low * step + size] += weights * first * signs[high]

    def add_terms(self, rows: Floats, weight: Floats, target: Floats) -> None:
        """Add ``weight * (rows @ unknowns - target)**2`` for each frame.

        Parameters
        ----------
        rows : (frames, channels) float64
        weight, target : (frames,) float64
        """
        step = self._channels
        for low in range(step):
            self._rhs[low::step] += weight * rows[:, low] * target
            for high in range(low, step):
                self._bands[high - low, low::step] += weight * rows[:, low] * rows[:, high]

    def increase(self, change: Floats) -> float:
        """By how much the sum at the solution grows for a change (frames, channels) of it."""
        flat = change.ravel()
        product = self._bands[0] * flat
        for offset in range(1, min(len(self._bands), len(flat))):
            product[offset:] += 2 * self._bands[offset, :-offset] * flat[:-offset]
        return float(product @ flat)

    def solve(self) -> Floats:
        """The unknowns (frames, channels) of the smallest sum."""
        solution = _solve(self._bands, self._rhs)
        return solution.reshape(self._frames, self._channels)


def _solve(bands: Floats, rhs: Floats) -> Floats:
    """Solve a symmetric positive definite banded system by blocks."""
    count = len(rhs)
    size = max(_BLOCK, len(bands))
    blocks = -(-count // size)
    diagonal, below = _blocks(bands, count, size, blocks)
    padded = np.zeros(blocks * size)
    padded[:count] = rhs
    values = padded.reshape(blocks, size, 1)
    gains = np.empty_like(below)
    for i in range(blocks):
        if i:
            diagonal[i] -= below[i - 1] @ gains[i - 1]
            values[i] -= below[i - 1] @ values[i - 1]
        solved = np.linalg.solve(diagonal[i], np.hstack([below[i].T, values[i]]))
        gains[i], values[i] = solved[:, :size], solved[:, size:]
    for i in range(blocks - 2, -1, -1):
        values[i] -= gains[i] @ values[i + 1]
    return padded[:count]


def _blocks(bands: Floats, count: int, size: int, blocks: int) -> tuple[Floats, Floats]:
    """Diagonal blocks (B, size, size), and those below them, of a padded banded matrix."""
    padded = np.zeros((len(bands), blocks * size))
    padded[:, :count] = bands
    padded[0, count:] = 1.0
    diagonal, below = np.zeros((blocks, size, size)), np.zeros((blocks, size, size))
    by_block = padded.reshape(len(bands), blocks, size)
    for offset in range(len(bands)):
        inside = np.arange(size - offset)
        diagonal[:, inside + offset, inside] = by_block[offset][:, inside]
        diagonal[:, inside, inside + offset] = by_block[offset][:, inside]
        across = np.arange(size - offset, size)
        below[:, across + offset - size, across] = by_block[offset][:, across]
    return diagonal, below
