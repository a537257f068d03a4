"""`TargetPath`: the path of the target through the scene, smoothed as far as it may be."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ssiam.render.banded import BandedLeastSquares, Floats
from ssiam.render.leveled import smoothness

Flags: TypeAlias = NDArray[np.bool_]

UNKNOWN: Final = 1e-6  # weight of a position where nothing is known; 1 is that of a box

# Chosen on the ten test sequences with white shake of 3 %, by benchmarks/render/locked.py
_PERIOD: Final = 1.5  # s: faster movements of the target are followed only as far as needed
_SHORT: Final = 0.45  # s in which the squared distance from the boxes is averaged
_LONG: Final = 1.0  # s in which the distance is averaged: noise cancels
_NOISE_FACTOR: Final = 1.7  # of the noise is accepted, since averages over _SHORT vary
_MEAN_NOISE_FACTOR: Final = 2.5
_MEAN_TOLERANCE: Final = 0.15  # of the tolerance
_NOISE_OF_SIZE: Final = 0.03  # sizes of the target: noise up to which it is accepted
_LARGEST_NOISE: Final = 0.05  # sizes of the target: noise of a tracker; more is movement

_ROUNDS: Final = 16  # in which the path gets closer to the boxes
_MAX_WEIGHT: Final = 1e8  # of a box
_DIFFERENCE: Final = 6  # order of the differences that noise is measured by


@dataclass(frozen=True, eq=False)
class TargetPath:
    """The smoothed path of the target in N frames.

    Attributes
    ----------
    xy : (N, 2) float64
        Center of the target, scene coordinates; where it is not seen, its last position, or its
        first one.
    weight : (N,) float64
        How closely the path follows the box: 1, and more where the target moves fast.
    """

    xy: Floats
    weight: Floats


def target_path(
    measured_xy: Floats, seen: Flags, size: Floats, tolerance: float, rate: float
) -> TargetPath:
    """The smoothest path whose distance from the boxes is their noise and the tolerance.

    Parameters
    ----------
    measured_xy : (N, 2) float64
        Centers of the boxes, scene coordinates; any finite numbers where `seen` is False.
    seen : (N,) bool
        At least one is True.
    size : (N,) float64
        Size of the target, pixels.
    tolerance : float
        Sizes of the target.
    rate : float
        Frames per second.
    """
    accepted = _Accepted(measured_xy, seen, size, tolerance, rate)
    weight = np.where(seen, 1.0, UNKNOWN)
    for _ in range(_ROUNDS):
        smooth = smooth_path(measured_xy, weight, _PERIOD * rate).solve()
        excess = accepted.excess(smooth)
        if excess.max() <= 1:
            break
        weight = np.where(seen, np.minimum(weight * np.maximum(excess, 1), _MAX_WEIGHT), UNKNOWN)
    for start, stop in gaps(seen):
        smooth[start:stop] = smooth[start - 1] if start else smooth[stop]
    return TargetPath(smooth, weight)


def smooth_path(positions: Floats, weight: Floats, period: float) -> BandedLeastSquares:
    """The problem of a path near positions (N, 2), without vibrations shorter than `period`."""
    problem = BandedLeastSquares(len(weight), 2)
    problem.add_difference(0, weight[:, None], positions)
    problem.add_difference(3, smoothness(period, 3))
    return problem


def gaps(known: Flags) -> list[tuple[int, int]]:
    """(start, stop) of the runs of frames that are not known."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], known, [True]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


class _Accepted:
    """The distance from the boxes that is accepted: their noise and the tolerance.

    Its mean over a longer time, in which noise cancels, must be smaller.
    """

    def __init__(
        self, measured_xy: Floats, seen: Flags, size: Floats, tolerance: float, rate: float
    ) -> None:
        self._measured_xy, self._seen = measured_xy, seen
        self._short, self._long = (2 * round(s * rate / 2) + 1 for s in (_SHORT, _LONG))
        measured_noise = _noise(measured_xy, seen)
        noise = np.minimum(measured_noise, _NOISE_OF_SIZE * size)
        is_noise = np.minimum(_LARGEST_NOISE * size / max(measured_noise, 1e-9), 1)
        self._squares = _NOISE_FACTOR * noise**2 + (tolerance * is_noise * size) ** 2
        self._mean_squares = (
            _MEAN_NOISE_FACTOR * noise**2 / self._long + (_MEAN_TOLERANCE * tolerance * size) ** 2
        )

    def excess(self, smooth: Floats) -> Floats:
        """Squared distance (N,) of a path from the boxes, in relation to the accepted one."""
        missed = np.where(self._seen[:, None], self._measured_xy - smooth, 0)
        squares = _local_mean((missed**2).sum(axis=1), self._seen, self._short)
        mean_x, mean_y = (_local_mean(each, self._seen, self._long) for each in missed.T)
        return np.maximum(squares / self._squares, (mean_x**2 + mean_y**2) / self._mean_squares)


def _local_mean(values: Floats, known: Flags, window: int) -> Floats:
    """Mean (N,) of the known values in a window around each frame; `window` is odd."""
    kernel = np.hanning(window + 2)[1:-1]
    total, count = (
        np.convolve(np.pad(each, window // 2), kernel, mode="valid")
        for each in (np.where(known, values, 0.0), known.astype(np.float64))
    )
    return np.asarray(total / np.maximum(count, 1e-9))


def _noise(positions: Floats, known: Flags) -> float:
    """Length of the positions' noise, root mean square, from differences of a high order."""
    if len(known) <= _DIFFERENCE:
        return 0.0
    whole = np.convolve(known, np.ones(_DIFFERENCE + 1), "valid") > _DIFFERENCE + 0.5
    squares = (np.diff(positions, _DIFFERENCE, axis=0)[whole] ** 2).sum(axis=1)
    if not len(squares):
        return 0.0
    # The squared length of two normal numbers is exponential: its median is its mean times log 2
    variance = np.median(squares) / np.log(2) / comb(2 * _DIFFERENCE, _DIFFERENCE)
    return float(np.sqrt(variance))
