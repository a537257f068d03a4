"""`Timeline`: frames by number for tools that find them by time and one frame rate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from ssiam.exchange.annotations import Annotations

# A frame is found by the nearest number if that is less than half the shortest gap away from it.
_NEAREST = 0.45
# Frames a second; finer grids are of no use to anybody who steps through them.
_HIGHEST_FPS = 1000


@dataclass(frozen=True)
class Timeline:
    """A constant frame rate, and each frame's number at it.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    fps : float or Fraction
        Frames a second: those of the video, unless its frames come at times of their own.
    count : int
        Frames of the whole video at this rate.
    numbers : dict of int to int
        By frame, both from 0, for the frames that have annotations.
    """

    fps: float | Fraction
    count: int
    numbers: dict[int, int]


def timeline(annotations: Annotations) -> Timeline:
    """The rate at which each frame's own time gives it a number of its own.

    Frames count as constant, ``number = frame``, where some have no time, or times run backwards.
    """
    told = {row.frame: row.time for row in annotations.rows if row.time is not None}
    origin = told.get(0, 0.0)
    times = {frame: time - origin for frame, time in told.items()}
    frames = sorted({row.frame for row in annotations.rows})
    known = [times[frame] for frame in frames if frame in times]
    gaps = [after - before for before, after in pairwise(known)]
    is_told = len(known) == len(frames) and min(gaps, default=1.0) > 0 and known[:1] >= [0.0]
    if not is_told or _is_constant(times, annotations.fps):
        return Timeline(annotations.fps, annotations.frame_count, {f: f for f in frames})
    fps = _fps(annotations.fps, known, min(gaps, default=1.0))
    numbers: dict[int, int] = {}
    last = -1
    for frame in frames:
        numbers[frame] = last = max(round(times[frame] * fps), last + 1)
    rest = (annotations.frame_count - frames[-1]) / annotations.fps
    count = max(numbers[frames[-1]] + 1, round((known[-1] + rest) * fps))
    return Timeline(fps, count, numbers)


def _is_constant(times: dict[int, float], fps: float | Fraction) -> bool:
    return all(abs(time * fps - frame) < 0.5 for frame, time in times.items())


def _fps(nominal: float | Fraction, times: list[float], gap: float) -> float | Fraction:
    """The lowest of some rates at which each of the `times` is nearest to its own number."""
    mean = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else nominal
    for fps in (nominal, Fraction(mean).limit_denominator(1001), Fraction(round(1 / gap))):
        if (
            0 < fps <= _HIGHEST_FPS
            and max(abs(t * fps - round(t * fps)) / fps for t in times) < _NEAREST * gap
        ):
            return fps
    return min(_HIGHEST_FPS, math.ceil(2 / gap))
