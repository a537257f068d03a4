"""`PacedFeed`: a recording that plays at its own pace, as a camera would."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from ssiam.errors import SsiamError
from ssiam.video import Frame, Source
from ssiam.web.errors import Note
from ssiam.web.feeds.newest import Newest, told_fps

_log = logging.getLogger(__name__)

# Seconds by which a frame may be late and still be caught up with, and by which it may be early
# and still be waited for. What is further off is a new beginning: a computer that slept, a
# recording that was joined from several.
_LATEST = 1.0
_EARLIEST = 10.0
# Seconds that `close` waits for the reader, which may be in the middle of a frame.
_CLOSING = 1.0


class PlayClock:
    """When the frames of a recording are due.

    Parameters
    ----------
    fps : float
        For frames without a time.
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._started: float | None = None

    def seconds_until(self, frame: Frame, now: float) -> float:
        """Seconds from `now` (`time.monotonic`) until the frame is due; not positive: it is."""
        ahead = 0.0 if self._started is None else self._started + self._time(frame) - now
        if self._started is None or not -_LATEST <= ahead <= _EARLIEST:
            self.start(frame, now)
            return 0.0
        return ahead

    def start(self, frame: Frame, now: float) -> None:
        """Count from this frame, due now."""
        self._started = now - self._time(frame)

    def delay(self, seconds: float) -> None:
        """Everything is due so much later."""
        if self._started is not None:
            self._started += seconds

    def _time(self, frame: Frame) -> float:
        return frame.index / self._fps if frame.time is None else frame.time


class PacedFeed(Newest):
    """Frames of a file, of a folder or of standard input, at their own pace.

    Parameters
    ----------
    source : Source
        Closed by the feed.
    notes : callable
        Told, on the feed's thread, if the source breaks off.
    reopen : callable or None
        Opens the source again for `restart`; None where that cannot be.
    in_step : bool
        Every frame waits until it is taken, and no clock counts.
    stop : callable or None
        Ends a source that waits for something, when the feed is closed.
    """

    def __init__(
        self,
        source: Source,
        notes: Callable[[Note], None],
        *,
        reopen: Callable[[], Source] | None = None,
        in_step: bool = False,
        stop: Callable[[], None] | None = None,
    ) -> None:
        super().__init__(source.name, source.size_wh, told_fps(source), source.length)
        self.pixel_aspect = source.info.pixel_aspect
        self.seekable = reopen is not None
        self._notes = notes
        self._reopen = reopen
        self._in_step = in_step
        self._stop = stop
        # Tells the reader of this run from those of earlier ones that have not noticed yet.
        self._run = 0
        self._begin(source)

    def restart(self) -> None:
        """Begin again with frame 0; while paused, that one is let through.

        Raises
        ------
        CommandError
            It is not `seekable`.
        SourceError
            It cannot be opened any more; what was playing goes on.
        """
        if self._reopen is None:
            super().restart()
            return
        self._begin(self._reopen())

    def close(self) -> None:
        """Let go of the source. May be called twice."""
        super().close()
        if self._stop is not None:
            self._stop()
        self._thread.join(_CLOSING)

    def _begin(self, source: Source) -> None:
        with self._changed:
            self._run += 1
            self.size_wh, self.fps = source.size_wh, float(source.fps)
            self.length = source.length
            self._waiting = None
            self._state = "playing"
            self._passes = 1 if self._paused else 0
            self._let_go = time.monotonic()
            self._changed.notify_all()
            self._thread = threading.Thread(
                target=self._read, args=(source, self._run), name="ssiam-feed", daemon=True
            )
            self._thread.start()

    def _read(self, source: Source, run: int) -> None:
        clock = PlayClock(float(source.fps))
        try:
            with source:
                for frame in source:
                    if not self._put_when_due(frame, clock, run):
                        return
        except SsiamError as error:
            self._notes(Note("error", str(error)))
        except Exception as error:
            _log.exception("reading %s", self.name)
            # Its text may hold the address with its password.
            text = f"{self.name} cannot be read any further ({type(error).__name__}); see the log"
            self._notes(Note("error", text))
        if source.info.undecoded:
            text = f"{source.info.undecoded} frames of {self.name} could not be decoded"
            self._notes(Note("warning", text))
        with self._changed:
            if run == self._run:
                self._state = "ended"
                self._changed.notify_all()

    def _put_when_due(self, frame: Frame, clock: PlayClock, run: int) -> bool:
        """Bring the frame at its time; False if this run is over before."""
        with self._changed:
            while run == self._run and not self._closed:
                now = time.monotonic()
                wait = self._seconds_to_wait(frame, clock, now)
                if wait == 0:
                    self._put(frame)
                    return True
                stands = self._paused
                self._changed.wait(wait)
                if stands:
                    clock.delay(time.monotonic() - now)
            return False

    def _seconds_to_wait(self, frame: Frame, clock: PlayClock, now: float) -> float | None:
        """0 if it is time; None until something changes.

        While paused one frame is kept ready, so that the next step needs no decoding.
        """
        if not self._paused and not self._in_step:
            return max(0.0, clock.seconds_until(frame, now))
        if self._waiting is not None:
            return None
        clock.start(frame, now)
        return 0.0
