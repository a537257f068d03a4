"""`ShakePath`: the path of a shaking camera at any time, by the kind of shake."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.geometry import Transform, frame_center

ShakeKind: TypeAlias = Literal["white", "handheld", "vibration", "gusts", "roll", "zoom"]
SHAKE_KINDS: Final[tuple[ShakeKind, ...]] = get_args(ShakeKind)
Floats: TypeAlias = NDArray[np.float64]

_PADDING: Final = 3  # frames before the first and after the last one, for long exposures

# Standard deviations of dx, dy (widths), angle (radians) and log zoom for a strength of 1
_SHIFTS: Final = (1.0, 1.0, np.deg2rad(1.0) / 0.03, 0.0)  # a roll of 1 degree with shifts of 3 %
_ROLL: Final = (0.0, 0.0, 2.0, 0.0)  # a point half a width from the center moves by one width
_ZOOM: Final = (0.0, 0.0, 0.0, 2.0)

# Hand-held
_MIN_FREQUENCY: Final = 0.01  # cycles per frame, below which the amplitude is constant
_MIN_SAMPLES: Final = 512  # frames of the inverse transform
# Vibration
_SINUSOIDS: Final = 5  # for each axis
_FREQUENCIES: Final = (0.15, 0.5)  # cycles per frame
_MODULATION: Final = (0.005, 0.02)  # cycles per frame of the slow change of amplitude
_MODULATION_DEPTH: Final = 0.5
# Gusts
_PROBABILITY: Final = 0.05  # of a gust in a frame
_THRESHOLD: Final = 1.6449  # a normal number exceeds it with that probability
_DECAY: Final = 10.0  # frames until 37 % of a gust remains
_WARMUP: Final = 100  # frames sampled before the first one


@dataclass(frozen=True, eq=False)
class ShakePath:
    """The path of a camera through a sequence, interpolated between the frames.

    Attributes
    ----------
    states : (N + 6, 4) float64
        dx, dy in pixels of the raw frame, angle in radians, log zoom at each frame, and at three
        more frames before the first and after the last one.
    center_xy : (float, float)
        Center of roll and zoom, raw-frame pixels.
    limits : (4,) float64
        Largest absolute value of each state; infinite without a limit.
    corner_xy : (int, int)
        Raw-frame pixel at the top left of the output when all states are 0.
    """

    states: Floats
    center_xy: tuple[float, float]
    limits: Floats
    corner_xy: tuple[int, int] = (0, 0)

    def at(self, times: ArrayLike) -> Transform:
        """shaken_from_raw (..., 3, 3) at times (...) in frames from 0, by cubic interpolation."""
        times = np.asarray(times, dtype=np.float64)
        first = np.floor(times).astype(np.intp)
        u = (times - first)[..., None]
        before, start, end, after = (self.states[first + _PADDING + i] for i in (-1, 0, 1, 2))
        # Catmull-Rom spline
        quadratic = 2 * before - 5 * start + 4 * end - after
        cubic = 3 * (start - end) + after - before
        states = start + 0.5 * u * (end - before + u * (quadratic + u * cubic))
        return self._transforms(np.clip(states, -self.limits, self.limits))

    def _transforms(self, states: Floats) -> Transform:
        dx, dy, angle, log_zoom = np.moveaxis(states, -1, 0)
        (cx, cy), (left, top) = self.center_xy, self.corner_xy
        cos, sin = np.exp(log_zoom) * np.cos(angle), np.exp(log_zoom) * np.sin(angle)
        shaken_from_raw = np.zeros((*dx.shape, 3, 3))
        shaken_from_raw[..., 0, 0] = shaken_from_raw[..., 1, 1] = cos
        shaken_from_raw[..., 0, 1], shaken_from_raw[..., 1, 0] = -sin, sin
        shaken_from_raw[..., 0, 2] = cx - cos * cx + sin * cy + dx - left
        shaken_from_raw[..., 1, 2] = cy - sin * cx - cos * cy + dy - top
        shaken_from_raw[..., 2, 2] = 1
        return shaken_from_raw


def sample_path(
    kind: ShakeKind, strength: float, seed: int, count: int, size_wh: tuple[int, int], name: str
) -> ShakePath:
    """A random path over `count` frames of (width, height) pixels, without limits.

    It depends only on the arguments; `name` is the name of the sequence, so that each sequence has
    a different path.
    """
    entropy = [seed, *(zlib.crc32(text.encode()) for text in (name, kind))]
    rng = np.random.default_rng(entropy)
    series = _SERIES[kind](count + 2 * _PADDING, rng)
    states = strength * deviations(kind, size_wh[0]) * series
    return ShakePath(states, frame_center(size_wh), np.full(4, np.inf))


def deviations(kind: ShakeKind, width: int) -> Floats:
    """Standard deviations (4,) of dx, dy (pixels), angle (radians) and log zoom at strength 1."""
    units = {"roll": _ROLL, "zoom": _ZOOM}.get(kind, _SHIFTS)
    return np.array(units) * (width, width, 1, 1)


# Each series is (count, 4), with standard deviation 1 in every column.


def _white(count: int, rng: np.random.Generator) -> Floats:
    return rng.normal(size=(count, 4))


def _handheld(count: int, rng: np.random.Generator) -> Floats:
    """Noise of amplitude 1/f with random phases; the number of samples is a power of two."""
    samples = max(_MIN_SAMPLES, 1 << (count - 1).bit_length())
    frequency = np.fft.rfftfreq(samples)[1:-1, None]
    amplitude = 1 / np.maximum(frequency, _MIN_FREQUENCY)
    phase = rng.uniform(0, 2 * np.pi, (len(frequency), 4))
    waves = np.zeros((samples // 2 + 1, 4), dtype=np.complex128)
    waves[1:-1] = amplitude * np.exp(1j * phase)
    deviation = np.sqrt(2 * (amplitude**2).sum()) / samples
    return np.asarray(np.fft.irfft(waves, samples, axis=0)[:count] / deviation)


def _vibration(count: int, rng: np.random.Generator) -> Floats:
    """Sinusoids with modulated amplitude."""
    shape = (_SINUSOIDS, 1, 4)
    time = np.arange(count)[:, None]
    phase, modulation_phase = rng.uniform(0, 2 * np.pi, (2, *shape))
    wave = np.sin(2 * np.pi * rng.uniform(*_FREQUENCIES, shape) * time + phase)
    modulation = 1 + _MODULATION_DEPTH * np.sin(
        2 * np.pi * rng.uniform(*_MODULATION, shape) * time + modulation_phase
    )
    variance = _SINUSOIDS / 2 * (1 + _MODULATION_DEPTH**2 / 2)
    return np.asarray((modulation * wave).sum(axis=0) / np.sqrt(variance))


def _gusts(count: int, rng: np.random.Generator) -> Floats:
    """Random impulses that decay exponentially."""
    impulses = rng.normal(size=(_WARMUP + count, 5))
    impulses = np.where(impulses[:, 4:] > _THRESHOLD, impulses[:, :4], 0.0)
    decay = np.exp(-np.arange(len(impulses)) / _DECAY)
    series = [np.convolve(column, decay)[_WARMUP : _WARMUP + count] for column in impulses.T]
    deviation = np.sqrt(_PROBABILITY / (1 - np.exp(-2 / _DECAY)))
    return np.asarray(np.stack(series, axis=1) / deviation)


_SERIES: Final[dict[ShakeKind, Callable[[int, np.random.Generator], Floats]]] = {
    "white": _white,
    "handheld": _handheld,
    "vibration": _vibration,
    "gusts": _gusts,
    "roll": _white,
    "zoom": _white,
}
