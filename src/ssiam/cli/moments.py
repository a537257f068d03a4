"""`Moment` and `PlannedTarget`: positions in a source, as frame numbers or as times."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.target_start import TargetStart
from ssiam.video import Frame

# Seconds by which a given time may differ from a frame's: result files round times to a
# microsecond, and containers to a millisecond.
_TIME_TOLERANCE = 0.001

_SECONDS = re.compile(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)s")
_CLOCK = re.compile(r"(?:([0-9]+):)?([0-9]+):([0-9]+(?:\.[0-9]*)?)")
_FRAME = re.compile(r"[0-9]+")
_LONGEST_NUMBER = 15  # digits of a frame number or of a time


@dataclass(frozen=True)
class Moment:
    """A position in a source: a frame number, or a time by the frames' own timestamps.

    Attributes
    ----------
    text : str
        As the user wrote it.
    frame : int or None
        Frame number, from 0.
    seconds : float or None
        Seconds since the first frame, if `frame` is None.
    """

    text: str
    frame: int | None = None
    seconds: float | None = None

    def is_reached(self, frame: Frame) -> bool:
        """Whether `frame` is at or after this moment; `ArgumentError` if it has no time."""
        if self.frame is not None:
            return frame.index >= self.frame
        return self._time_of(frame) >= self._seconds() - _TIME_TOLERANCE

    def is_passed(self, frame: Frame) -> bool:
        """Whether `frame` is after this moment; `ArgumentError` if it has no time."""
        if self.frame is not None:
            return frame.index > self.frame
        return self._time_of(frame) > self._seconds() + _TIME_TOLERANCE

    def is_before(self, other: Moment) -> bool:
        """Whether this moment is known to be before the other; False if the units differ."""
        if self.frame is not None and other.frame is not None:
            return self.frame < other.frame
        if self.seconds is not None and other.seconds is not None:
            return self.seconds < other.seconds
        return False

    def _seconds(self) -> float:
        assert self.seconds is not None
        return self.seconds

    def _time_of(self, frame: Frame) -> float:
        if frame.time is None:
            raise ArgumentError(
                f"the source has no timestamps, so {self.text} cannot be found in it: give the "
                "number of a frame, such as 300"
            )
        return frame.time


def parse_moment(text: str) -> Moment | None:
    """The moment that ``300``, ``12s``, ``12.5s``, ``0:12`` or ``1:02:03.5`` means; else None."""
    if len(text) > _LONGEST_NUMBER:
        return None
    if _FRAME.fullmatch(text):
        return Moment(text, frame=int(text))
    seconds, clock = _SECONDS.fullmatch(text), _CLOCK.fullmatch(text)
    if seconds is not None:
        return Moment(text, seconds=float(seconds[1]))
    if clock is None:
        return None
    hours, minutes, rest = clock.groups()
    if float(rest) >= 60 or (hours is not None and int(minutes) >= 60):
        return None
    return Moment(text, seconds=3600 * int(hours or 0) + 60 * int(minutes) + float(rest))


def moment_option(option: str, text: str | None) -> Moment | None:
    """The moment given to `option`; `ArgumentError` if the text is not one."""
    if text is None:
        return None
    moment = parse_moment(text)
    if moment is None:
        raise ArgumentError(
            f"{option} {text!r} is not a frame or a time: give a frame number, such as 300, or a "
            "time, such as 12s, 0:12 or 1:02:03.5"
        )
    return moment


@dataclass(frozen=True)
class PlannedTarget:
    """A target that is to be tracked.

    Attributes
    ----------
    xywh : (float, float, float, float)
        x, y, width, height in raw pixels of the frame in which it begins.
    begins : Moment or None
        When it begins; None for the first frame that is tracked.
    label : str
        Name in messages: the option as the user wrote it.
    """

    xywh: XYWH
    begins: Moment | None = None
    label: str = "the target"

    @classmethod
    def from_start(cls, start: TargetStart) -> PlannedTarget:
        """The plan for a `TargetStart`."""
        x, y, w, h = start.xywh
        box = ",".join(f"{value:g}" for value in start.xywh)
        begins = Moment(str(start.frame), frame=start.frame)
        return cls((x, y, w, h), begins, f"the target {start.frame}:{box}")


@dataclass(frozen=True)
class Span:
    """The frames that are tracked and written: from `start` to `end`, both included."""

    start: Moment | None = None
    end: Moment | None = None

    @classmethod
    def of_frames(cls, first: int, last: int) -> Span:
        """The frames from number `first` to number `last`."""
        return cls(*(Moment(str(index), frame=index) for index in (first, last)))

    def check(self, targets: list[PlannedTarget]) -> None:
        """Raise `ArgumentError` if the end is before the start, or a target begins outside."""
        if self.start is not None and self.end is not None and self.end.is_before(self.start):
            raise ArgumentError(
                f"--end {self.end.text} is before --start {self.start.text}: swap them"
            )
        for target in targets:
            if target.begins is None:
                continue
            if self.start is not None and target.begins.is_before(self.start):
                raise ArgumentError(begins_before_start(target, self.start))
            if self.end is not None and self.end.is_before(target.begins):
                raise ArgumentError(
                    f"{target.label} begins after --end {self.end.text}: give a later --end, or "
                    "a box of an earlier frame"
                )


WHOLE_SOURCE = Span()


def begins_before_start(target: PlannedTarget, start: Moment) -> str:
    """The message for a target that begins before ``--start``."""
    return (
        f"{target.label} begins before --start {start.text}: give an earlier --start, or a box "
        "of a later frame"
    )
