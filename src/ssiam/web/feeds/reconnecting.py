"""`ReconnectingFeed`: a camera or network stream that is opened again when it is lost."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Final

from ssiam.addresses import stack_of
from ssiam.errors import SsiamError
from ssiam.video import Frame, Source
from ssiam.web.feeds.base import Feed, known_fps
from ssiam.web.feeds.paced import PlayClock
from ssiam.web.types import Note

_log = logging.getLogger(__name__)

# Seconds between attempts: the first wait, doubled up to the maximum. After the server is back,
# frames resume within the maximum, plus the second that FFmpeg takes to probe a stream.
_FIRST_WAIT: Final = 0.25
_MAX_WAIT: Final = 1.0
_STABLE_SECONDS: Final = 5.0  # duration of a connection after which the waits start over
# Seconds by which a stream's time may deviate from the clock; its buffer arrives all at once.
_MAX_DRIFT: Final = 3.0
_CLOSE_TIMEOUT: Final = 1.0  # seconds that `close` waits for the reader, which may be blocked


class StreamTime:
    """Indices and times that continue across reconnections.

    Times are those of the stream if it has any and they agree with the clock, else times of
    arrival.
    """

    def __init__(self) -> None:
        self._count = 0
        self._last_time = 0.0
        self._last_arrival = 0.0
        self._offset: float | None = None  # our time minus the stream's
        self._start = 0.0  # the clock at time 0
        self._is_trusted = True

    def reconnect(self) -> None:
        """The stream was opened again: the next frame's time counts from another origin."""
        self._offset = None
        self._start = 0.0
        self._is_trusted = True

    def renumber(self, frame: Frame, now: float) -> Frame:
        """A frame that arrived at `now` (s), with its index and time (s) since the first one."""
        by_arrival = self._last_time + now - self._last_arrival if self._count else 0.0
        time = self._time(frame, by_arrival, now)
        numbered = Frame(self._count, time, frame.image)
        self._count, self._last_time, self._last_arrival = self._count + 1, time, now
        return numbered

    def _time(self, frame: Frame, by_arrival: float, now: float) -> float:
        if frame.time is None or not self._is_trusted:
            return by_arrival
        if self._offset is None:
            self._offset, self._start = by_arrival - frame.time, now - by_arrival
            return by_arrival
        time = frame.time + self._offset
        # Some streams state a wrong rate; in others the time jumps or starts again.
        self._is_trusted = time > self._last_time and abs(time + self._start - now) <= _MAX_DRIFT
        return time if self._is_trusted else by_arrival


class ReconnectingFeed(Feed):
    """Frames of a camera or of a network stream, until it is closed.

    The source is read even while paused, so that neither the driver nor the server queues frames.
    Only a stream that states its length can end.

    Parameters
    ----------
    source : Source
        Closed by the feed.
    notify : callable
        Receives notes, on the feed's thread, when the source is lost and when it is back.
    reopen : callable
        Opens the source again.
    in_bursts : bool
        Whether the source delivers many frames at once, which are then played in real time.
    """

    def __init__(
        self,
        source: Source,
        notify: Callable[[Note], None],
        reopen: Callable[[], Source],
        *,
        in_bursts: bool = False,
    ) -> None:
        super().__init__(source.name, source.size_wh, known_fps(source))
        self.pixel_aspect = source.info.pixel_aspect
        self._notify = notify
        self._reopen = reopen
        self._in_bursts = in_bursts
        self._wait = _FIRST_WAIT
        self._time = StreamTime()
        self._thread = threading.Thread(
            target=self._run, args=(source,), name="ssiam-feed", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Close the source. May be called twice."""
        super().close()
        self._thread.join(_CLOSE_TIMEOUT)

    def _run(self, source: Source) -> None:
        connected: Source | None = source
        while connected is not None:
            began = time.monotonic()
            if self._read_to_end(connected):
                self._state = "ended"
                return
            if time.monotonic() - began > _STABLE_SECONDS:
                self._wait = _FIRST_WAIT
            connected = self._reconnect()

    def _read_to_end(self, source: Source) -> bool:
        """Put all frames; return whether the source has a stated length and has reached its end."""
        clock = PlayClock(float(source.fps)) if self._in_bursts else None
        try:
            with source:
                for frame in source:
                    early = clock.seconds_until(frame, time.monotonic()) if clock else 0.0
                    if self._is_closed_after(early):
                        return False
                    self._put(self._time.renumber(frame, time.monotonic()))
        except SsiamError as error:
            _log.info("%s", error)
            return False
        except Exception as error:
            _log.error("reading %s: %s", self.name, stack_of(error))
            return False
        return source.length is not None

    def _reconnect(self) -> Source | None:
        """Open the source again, with any number of attempts; None if the feed is closed."""
        if self._closed:
            return None
        self._state = "reconnecting"
        self._notify(Note("warning", f"{self.name}: connection lost; trying to reconnect"))
        while not self._is_closed_after(self._wait):
            self._wait = min(2 * self._wait, _MAX_WAIT)
            try:
                source = self._reopen()
            except SsiamError as error:
                _log.debug("%s", error)
                continue
            except Exception as error:
                _log.error("opening %s: %s", self.name, stack_of(error))
                continue
            self._resume(source)
            return source
        return None

    def _resume(self, source: Source) -> None:
        """Continue with a source that was opened again."""
        before, self.size_wh = self.size_wh, source.size_wh
        self.fps, self.pixel_aspect = known_fps(source), source.info.pixel_aspect
        self._time.reconnect()
        self._state = "playing"
        width, height = source.size_wh
        change = "" if before == source.size_wh else f", now with {width}x{height} pixels"
        self._notify(Note("warning" if change else "info", f"{self.name}: reconnected{change}"))

    def _is_closed_after(self, seconds: float) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: self._closed, seconds)
