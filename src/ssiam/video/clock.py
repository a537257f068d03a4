"""`Clock`: the times of frames as whole ticks of a video file."""

from __future__ import annotations

from fractions import Fraction

# Ticks a second at least: variable frame rates are kept to 0.1 ms.
_RESOLUTION = 10_000
# Denominators of real frame rates are 1 and 1001.
_LARGEST_DENOMINATOR = 1001

# A time this many frames before the last one is a new beginning, not rounding or disorder.
_JUMP_STEPS = 10


def as_rate(fps: Fraction | float) -> Fraction:
    """The exact frame rate: 29.97002997 becomes 30000/1001; `ValueError` if it is none."""
    if not 0 < fps < float("inf"):
        raise ValueError(f"frame rate {fps} is not a positive number of frames a second")
    return (
        fps if isinstance(fps, Fraction) else Fraction(fps).limit_denominator(_LARGEST_DENOMINATOR)
    )


class Clock:
    """Counts strictly growing ticks from 0, of ``time_base`` seconds each.

    Parameters
    ----------
    rate : Fraction
        Frames a second, the step of frames without a time. A frame lasts a whole number of ticks.
    only_whole_frames : bool
        Ticks are whole frames, for containers that know no other times. A frame that would come
        more than one of them too late has no place.
    parts : int
        How many whole frames of the container a frame lasts, with `only_whole_frames`.
    """

    def __init__(self, rate: Fraction, *, only_whole_frames: bool = False, parts: int = 1) -> None:
        self._may_refuse = only_whole_frames
        finer = -(-_RESOLUTION // rate.numerator)
        self.time_base = (
            1 / (rate * parts) if only_whole_frames else Fraction(1, rate.numerator * finer)
        )
        self._step = parts if only_whole_frames else rate.denominator * finer
        self._last: int | None = None
        self._origin: int | None = None

    @property
    def end(self) -> int:
        """Ticks at which the last frame ends, if it lasts one step."""
        return 0 if self._last is None else self._last + self._step

    def place(self, time: float | None = None) -> int | None:
        """`ticks`, or None for a frame that comes too soon after others to be shown in time."""
        last, origin = self._last, self._origin
        if self._may_refuse and time is not None and last is not None and origin is not None:
            due = time / self.time_base - origin
            if last - _JUMP_STEPS * self._step <= due < last:
                return None
        return self.ticks(time)

    def ticks(self, time: float | None = None) -> int:
        """Ticks of the next frame, at `time` seconds of any origin, or one step later if None.

        Where times jump back, as in joined recordings, counting goes on with one step; times
        that are too close together are moved by single ticks.
        """
        following = 0 if self._last is None else self._last + self._step
        ticks = following if time is None else self._told(round(time / self.time_base), following)
        self._last = ticks
        return ticks

    def _told(self, told: int, following: int) -> int:
        """Ticks since the origin, which the first time sets and a jump back sets anew."""
        last = -1 if self._last is None else self._last
        if self._origin is None or told - self._origin < last - _JUMP_STEPS * self._step:
            self._origin = told - following
        return max(told - self._origin, last + 1)
