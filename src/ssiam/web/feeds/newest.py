"""`Newest`: between who brings frames and who takes them, one frame and never a queue."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, TypeAlias

from ssiam.video import Frame, Source
from ssiam.web.errors import CommandError

FeedState: TypeAlias = Literal["playing", "reconnecting", "ended"]


@dataclass(frozen=True, eq=False)
class Arrival:
    """A frame and when it came.

    Attributes
    ----------
    frame : Frame
        As the source delivered it.
    arrived : float
        Seconds of `time.monotonic`. A frame that came while all stood still counts as come when
        it was let through.
    """

    frame: Frame
    arrived: float


def told_fps(source: Source) -> float | None:
    """Frames a second as the source tells them; None where it tells none."""
    return float(source.fps) if source.info.is_rate_known else None


class Newest:
    """What all feeds have in common: the newest frame, and standing still.

    A subclass brings the frames. All methods may be called from any thread.

    Parameters
    ----------
    name : str
    size_wh : (int, int) or None
        Pixels; None as long as it is unknown.
    fps : float or None
        Frames a second, nominal; None as long as it is unknown.
    length : int or None
        Announced number of frames.
    """

    seekable = False
    # Width of a pixel by its height, as players are to show it.
    pixel_aspect = Fraction(1)

    def __init__(
        self,
        name: str,
        size_wh: tuple[int, int] | None = None,
        fps: float | None = None,
        length: int | None = None,
    ) -> None:
        self.name = name
        self.size_wh = size_wh
        self.fps = fps
        self.length = length
        self._changed = threading.Condition()
        self._waiting: Arrival | None = None
        self._state: FeedState = "playing"
        self._closed = False
        self._dropped = 0
        self._paused = False
        # Frames that may pass while paused.
        self._passes = 0
        self._let_go = 0.0

    @property
    def state(self) -> FeedState:
        """What it is doing; it has ended when its last frame has been taken."""
        with self._changed:
            is_over = self._state == "ended" and self._waiting is None
            return "playing" if self._state == "ended" and not is_over else self._state

    @property
    def dropped(self) -> int:
        """Frames left out for newer ones since the beginning."""
        return self._dropped

    def take(self, timeout: float) -> Arrival | None:
        """The newest frame not yet taken; None if none came for `timeout` seconds, or if closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._may_take(), timeout)
            if self._closed or not self._may_take() or self._waiting is None:
                return None
            waiting, self._waiting = self._waiting, None
            self._passes -= self._paused
            self._changed.notify_all()
            return Arrival(waiting.frame, max(waiting.arrived, self._let_go))

    def pause(self, paused: bool) -> None:
        """Stand still (True) or go on (False)."""
        with self._changed:
            if paused == self._paused:
                return
            self._paused = paused
            self._passes = 0
            if not paused:
                self._let_go = time.monotonic()
            self._changed.notify_all()

    def advance(self) -> None:
        """Let one more frame through while paused: of a live source the newest."""
        with self._changed:
            if self._paused:
                self._passes += 1
                self._let_go = time.monotonic()
                self._changed.notify_all()

    def restart(self) -> None:
        """Begin again; `CommandError` here, for only files can."""
        raise CommandError("not-possible", f"{self.name} cannot be started again")

    def close(self) -> None:
        """Let go of the source. May be called twice."""
        with self._changed:
            self._closed = True
            self._waiting = None
            self._changed.notify_all()

    def _put(self, frame: Frame) -> None:
        """Bring a frame, at once; it takes the place of one that was not taken."""
        with self._changed:
            # What comes while all stands still is not meant to be taken.
            self._dropped += self._waiting is not None and not self._paused
            self._waiting = Arrival(frame, time.monotonic())
            self._changed.notify_all()

    def _may_take(self) -> bool:
        return self._waiting is not None and (not self._paused or self._passes > 0)
