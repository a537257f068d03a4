"""`CameraPath`: how a shaking camera goes, by the kind of shake, at any moment."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.geometry import Transform, frame_centre

ShakeKind: TypeAlias = Literal["white", "handheld", "vibration", "gusts", "roll", "zoom"]
SHAKE_KINDS: Final[tuple[ShakeKind, ...]] = get_args(ShakeKind)
Floats: TypeAlias = NDArray[np.float64]

# Frames before the first and after the last one, for exposures that begin earlier or end later.
_AROUND: Final = 3

# One standard deviation of dx, dy (widths), angle (radians) and log zoom, for a strength of 1.
_SHIFTS: Final = (1.0, 1.0, np.deg2rad(1.0) / 0.03, 0.0)  # a roll of 1 degree beside shifts of 3 %
_ROLL: Final = (0.0, 0.0, 2.0, 0.0)  # what lies half a width off the centre moves by one width
_ZOOM: Final = (0.0, 0.0, 0.0, 2.0)

# Hand-held: cycles a frame below which the amplitude does not grow further; least frames drawn.
_SLOWEST: Final = 0.01
_DRAWN: Final = 512
# Vibration: sinusoids for each axis, their cycles a frame, those of their slow swell, its depth.
_SINUSOIDS: Final = 5
_FAST: Final = (0.15, 0.5)
_SWELL: Final = (0.005, 0.02)
_DEPTH: Final = 0.5
# Gusts: chance of one in a frame, frames until 37 % is left of it, frames drawn before the first.
_CHANCE: Final = 0.05
_RARE: Final = 1.6449  # which a normal number exceeds with that chance
_DECAY: Final = 10.0
_EARLIER: Final = 100


@dataclass(frozen=True, eq=False)
class CameraPath:
    """A camera's way through a sequence, smooth between the frames.

    Attributes
    ----------
    states : (N + 6, 4) float64
        dx, dy in pixels of the raw frame, angle in radians, log zoom, at whole frames; three more
        before the first frame and after the last one.
    center_xy : (float, float)
        What the camera rolls and zooms about, raw-frame pixels.
    limits : (4,) float64
        How far each state may go at most; infinite without a limit.
    corner_xy : (int, int)
        Raw-frame pixel that is the top left one of the output where the camera stands still.
    """

    states: Floats
    center_xy: tuple[float, float]
    limits: Floats
    corner_xy: tuple[int, int] = (0, 0)

    def at(self, times: ArrayLike) -> Transform:
        """shaken_from_raw (..., 3, 3) at times (...), in frames from 0 on, by cubics between."""
        times = np.asarray(times, dtype=np.float64)
        first = np.floor(times).astype(np.intp)
        u = (times - first)[..., None]
        before, start, end, after = (self.states[first + _AROUND + i] for i in (-1, 0, 1, 2))
        # Catmull-Rom: through every state, with the mean of both sides' slopes.
        bend = 2 * before - 5 * start + 4 * end - after
        turn = 3 * (start - end) + after - before
        states = start + 0.5 * u * (end - before + u * (bend + u * turn))
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


def path_of(
    kind: ShakeKind, strength: float, seed: int, count: int, size_wh: tuple[int, int], name: str
) -> CameraPath:
    """The path over `count` frames of (width, height) pixels; without limits."""
    words = [seed, *(zlib.crc32(text.encode()) for text in (name, kind))]
    rng = np.random.default_rng(words)
    series = _SERIES[kind](count + 2 * _AROUND, rng)
    states = strength * deviations(kind, size_wh[0]) * series
    return CameraPath(states, frame_centre(size_wh), np.full(4, np.inf))


def deviations(kind: ShakeKind, width: int) -> Floats:
    """Standard deviations (4,) of dx, dy (pixels), angle and log zoom for a strength of 1."""
    units = {"roll": _ROLL, "zoom": _ZOOM}.get(kind, _SHIFTS)
    return np.array(units) * (width, width, 1, 1)


# Each series is (count, 4), of standard deviation 1 in every column.


def _white(count: int, rng: np.random.Generator) -> Floats:
    return rng.normal(size=(count, 4))


def _handheld(count: int, rng: np.random.Generator) -> Floats:
    """Amplitude 1/f with random phases; drawn in powers of two, so that it seldom depends on N."""
    drawn = max(_DRAWN, 1 << (count - 1).bit_length())
    frequency = np.fft.rfftfreq(drawn)[1:-1, None]
    amplitude = 1 / np.maximum(frequency, _SLOWEST)
    phase = rng.uniform(0, 2 * np.pi, (len(frequency), 4))
    waves = np.zeros((drawn // 2 + 1, 4), dtype=np.complex128)
    waves[1:-1] = amplitude * np.exp(1j * phase)
    deviation = np.sqrt(2 * (amplitude**2).sum()) / drawn
    return np.asarray(np.fft.irfft(waves, drawn, axis=0)[:count] / deviation)


def _vibration(count: int, rng: np.random.Generator) -> Floats:
    shape = (_SINUSOIDS, 1, 4)
    time = np.arange(count)[:, None]
    phase, swell_phase = rng.uniform(0, 2 * np.pi, (2, *shape))
    wave = np.sin(2 * np.pi * rng.uniform(*_FAST, shape) * time + phase)
    swell = 1 + _DEPTH * np.sin(2 * np.pi * rng.uniform(*_SWELL, shape) * time + swell_phase)
    variance = _SINUSOIDS / 2 * (1 + _DEPTH**2 / 2)
    return np.asarray((swell * wave).sum(axis=0) / np.sqrt(variance))


def _gusts(count: int, rng: np.random.Generator) -> Floats:
    kicks = rng.normal(size=(_EARLIER + count, 5))
    kicks = np.where(kicks[:, 4:] > _RARE, kicks[:, :4], 0.0)
    left = np.exp(-np.arange(len(kicks)) / _DECAY)
    series = [np.convolve(column, left)[_EARLIER : _EARLIER + count] for column in kicks.T]
    deviation = np.sqrt(_CHANCE / (1 - np.exp(-2 / _DECAY)))
    return np.asarray(np.stack(series, axis=1) / deviation)


_SERIES: Final[dict[ShakeKind, Callable[[int, np.random.Generator], Floats]]] = {
    "white": _white,
    "handheld": _handheld,
    "vibration": _vibration,
    "gusts": _gusts,
    "roll": _white,
    "zoom": _white,
}
