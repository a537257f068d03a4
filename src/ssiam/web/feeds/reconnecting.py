"""`ReconnectingFeed`: a camera or stream that is read without rest and found again when it goes."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from ssiam.errors import SsiamError
from ssiam.video import Frame, Source
from ssiam.web.errors import Note
from ssiam.web.feeds.newest import Newest, told_fps
from ssiam.web.feeds.pacing import PlayClock

_log = logging.getLogger(__name__)

# Seconds between attempts: the first, doubled up to the longest, which is also how much later
# than the server the frames may come back, apart from the second that FFmpeg takes to look at a
# stream.
_FIRST_WAIT = 0.25
_LONGEST_WAIT = 1.0
# A connection that lasted this many seconds was a good one: the waits begin anew.
_LASTING = 5.0
# Seconds by which a stream's own time may differ from ours; what it had in store comes at once.
_DRIFT = 3.0
# Seconds that `close` waits for the reader, which may wait for a frame.
_CLOSING = 1.0


class StreamTime:
    """Numbers and times that go on over the gaps between connections.

    Times are the stream's own, as long as it tells some and they keep to ours, else of arrival.
    """

    def __init__(self) -> None:
        self._count = 0
        self._last = 0.0
        self._arrived = 0.0
        self.reconnected()

    def reconnected(self) -> None:
        """Take the next frame's time as counted from another origin."""
        self._offset: float | None = None
        self._behind = 0.0
        self._is_trusted = True

    def numbered(self, frame: Frame, now: float) -> Frame:
        """The frame, which came `now`, with its number and time (seconds) since the first one."""
        by_arrival = self._last + now - self._arrived if self._count else 0.0
        time = self._told(frame, by_arrival, now)
        numbered = Frame(self._count, time, frame.image)
        self._count, self._last, self._arrived = self._count + 1, time, now
        return numbered

    def _told(self, frame: Frame, by_arrival: float, now: float) -> float:
        if frame.time is None or not self._is_trusted:
            return by_arrival
        if self._offset is None:
            self._offset, self._behind = by_arrival - frame.time, now - by_arrival
            return by_arrival
        time = frame.time + self._offset
        # Some streams count frames of a rate that is not theirs, others jump or begin anew.
        self._is_trusted = time > self._last and abs(time + self._behind - now) <= _DRIFT
        return time if self._is_trusted else by_arrival


class ReconnectingFeed(Newest):
    """Frames of a camera or of a network stream, until it is closed.

    It is read also while paused, so that neither the driver nor the server has to queue. Only a
    stream that announces a length can end.

    Parameters
    ----------
    source : Source
        Closed by the feed.
    notes : callable
        Told, on the feed's thread, when the source is gone and when it is back.
    reopen : callable
        Opens the source again.
    in_bursts : bool
        The source delivers many frames at once, to be played at their own pace.
    """

    def __init__(
        self,
        source: Source,
        notes: Callable[[Note], None],
        reopen: Callable[[], Source],
        *,
        in_bursts: bool = False,
    ) -> None:
        super().__init__(source.name, source.size_wh, told_fps(source))
        self.pixel_aspect = source.info.pixel_aspect
        self._notes = notes
        self._reopen = reopen
        self._in_bursts = in_bursts
        self._wait = _FIRST_WAIT
        self._time = StreamTime()
        self._thread = threading.Thread(
            target=self._run, args=(source,), name="ssiam-feed", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Let go of the source. May be called twice."""
        super().close()
        self._thread.join(_CLOSING)

    def _run(self, source: Source) -> None:
        connected: Source | None = source
        while connected is not None:
            began = time.monotonic()
            if self._is_read_to_its_end(connected):
                self._state = "ended"
                return
            if time.monotonic() - began > _LASTING:
                self._wait = _FIRST_WAIT
            connected = self._found_again()

    def _is_read_to_its_end(self, source: Source) -> bool:
        """Bring all frames; whether the source came to the end that it had announced."""
        clock = PlayClock(float(source.fps)) if self._in_bursts else None
        try:
            with source:
                for frame in source:
                    early = clock.seconds_until(frame, time.monotonic()) if clock else 0.0
                    if self._is_closed_after(early):
                        return False
                    self._put(self._time.numbered(frame, time.monotonic()))
        except SsiamError as error:
            _log.info("%s", error)
            return False
        except Exception:
            _log.exception("reading %s", self.name)
            return False
        return source.length is not None

    def _found_again(self) -> Source | None:
        """The source, opened again; None if the feed is closed."""
        if self._closed:
            return None
        self._state = "reconnecting"
        self._notes(Note("warning", f"{self.name} is gone; trying again until it is back"))
        while not self._is_closed_after(self._wait):
            self._wait = min(2 * self._wait, _LONGEST_WAIT)
            try:
                source = self._reopen()
            except SsiamError as error:
                _log.debug("%s", error)
                continue
            except Exception:
                _log.exception("opening %s", self.name)
                continue
            self._welcome(source)
            return source
        return None

    def _welcome(self, source: Source) -> None:
        """Go on with a source that is back."""
        before, self.size_wh = self.size_wh, source.size_wh
        self.fps, self.pixel_aspect = told_fps(source), source.info.pixel_aspect
        self._time.reconnected()
        self._state = "playing"
        width, height = source.size_wh
        change = "" if before == source.size_wh else f", now with {width}x{height} pixels"
        self._notes(Note("warning" if change else "info", f"{self.name} is back{change}"))

    def _is_closed_after(self, seconds: float) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: self._closed, seconds)
