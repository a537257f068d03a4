"""`Feed`: delivers the newest frame of a source; base of all feeds."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, TypeAlias

from ssiam.video import Frame, Source
from ssiam.web.types import CommandError

FeedState: TypeAlias = Literal["playing", "reconnecting", "ended"]


@dataclass(frozen=True, eq=False)
class Arrival:
    """A frame and its time of arrival.

    Attributes
    ----------
    frame : Frame
    arrived : float
        Seconds of `time.monotonic`. For a frame that arrived while the feed was paused, the time
        at which it was released.
    """

    frame: Frame
    arrived: float


def known_fps(source: Source) -> float | None:
    """Frames per second if the source states the rate, else None."""
    return float(source.fps) if source.info.is_rate_known else None


class Feed:
    """Delivers the newest frame of a source; older frames are dropped, never queued.

    Subclasses add the frames, on their own thread. All methods are safe to call from any thread.

    Parameters
    ----------
    name : str
        The source in messages; must not contain a password.
    size_wh : (int, int) or None
        Frame size in pixels; None until it is known.
    fps : float or None
        Frames per second, as stated by the source or as measured; None if unknown.
    length : int or None
        Stated number of frames; None for live sources.

    Attributes
    ----------
    name, size_wh, fps, length
        The parameters; may change when the source is opened again.
    seekable : bool
        Whether `restart` works.
    pixel_aspect : Fraction
        Width of a pixel divided by its height, for players.
    """

    seekable = False
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
        self._newest: Arrival | None = None
        self._state: FeedState = "playing"
        self._closed = False
        self._dropped = 0
        self._paused = False
        self._passes = 0  # number of frames that may be taken while paused
        self._released_at = 0.0

    @property
    def state(self) -> FeedState:
        """State of the source; "ended" once its last frame has been taken."""
        with self._changed:
            is_over = self._state == "ended" and self._newest is None
            return "playing" if self._state == "ended" and not is_over else self._state

    @property
    def paused(self) -> bool:
        """Whether the feed is paused."""
        return self._paused

    @property
    def dropped(self) -> int:
        """Number of frames replaced by newer ones since the beginning, pauses excluded."""
        return self._dropped

    def take(self, timeout: float) -> Arrival | None:
        """Take the newest frame, unless it was taken before.

        None if none arrives within `timeout` seconds, or if the feed is closed.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._may_take(), timeout)
            if self._closed or not self._may_take() or self._newest is None:
                return None
            newest, self._newest = self._newest, None
            self._passes -= self._paused
            self._changed.notify_all()
            return Arrival(newest.frame, max(newest.arrived, self._released_at))

    def pause(self, paused: bool) -> None:
        """Pause (True) or resume (False)."""
        with self._changed:
            if paused == self._paused:
                return
            self._paused = paused
            self._passes = 0
            if not paused:
                self._released_at = time.monotonic()
            self._changed.notify_all()

    def advance(self) -> None:
        """Release one more frame while paused: the next one of a file, the newest of a stream."""
        with self._changed:
            if self._paused:
                self._passes += 1
                self._released_at = time.monotonic()
                self._changed.notify_all()

    def restart(self, index: int = 0) -> None:
        """Play again from a frame on, also after the end; while paused, that frame is released.

        If the source ends before that frame, nothing is played.

        Raises
        ------
        CommandError
            The feed is not `seekable`.
        SourceError
            The source cannot be opened again.
        """
        raise CommandError("not-possible", f"{self.name} cannot be restarted")

    def close(self) -> None:
        """Close the source. May be called twice."""
        with self._changed:
            self._closed = True
            self._newest = None
            self._changed.notify_all()

    def _put(self, frame: Frame) -> None:
        """Replace the newest frame, without blocking."""
        with self._changed:
            # Frames that arrive during a pause do not count as dropped.
            self._dropped += self._newest is not None and not self._paused
            self._newest = Arrival(frame, time.monotonic())
            self._changed.notify_all()

    def _may_take(self) -> bool:
        return self._newest is not None and (not self._paused or self._passes > 0)
