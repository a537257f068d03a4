"""`PacedFeed`: a file that plays in real time, as a camera would."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Final

from ssiam.addresses import stack_of
from ssiam.errors import SsiamError
from ssiam.video import Frame, Source
from ssiam.web.feeds.base import Feed
from ssiam.web.types import Note

_log = logging.getLogger(__name__)

# Seconds by which a frame may be late or early. Beyond these limits the clock restarts: the
# computer was suspended, or the file was joined from several.
_MAX_LATE: Final = 1.0
_MAX_EARLY: Final = 10.0
_CLOSE_TIMEOUT: Final = 1.0  # seconds that `close` waits for the reader, which may be decoding


class PlayClock:
    """When the frames of a source are due, by their own times.

    Parameters
    ----------
    fps : float
        For frames without a time.
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._started: float | None = None

    def seconds_until(self, frame: Frame, now: float) -> float:
        """Seconds from `now` (`time.monotonic`) until the frame is due; 0 or less if it is due."""
        ahead = 0.0 if self._started is None else self._started + self._time(frame) - now
        if self._started is None or not -_MAX_LATE <= ahead <= _MAX_EARLY:
            self.start(frame, now)
            return 0.0
        return ahead

    def start(self, frame: Frame, now: float) -> None:
        """Restart the clock so that this frame is due now."""
        self._started = now - self._time(frame)

    def delay(self, seconds: float) -> None:
        """Shift all due times by `seconds`."""
        if self._started is not None:
            self._started += seconds

    def _time(self, frame: Frame) -> float:
        return frame.index / self._fps if frame.time is None else frame.time


class PacedFeed(Feed):
    """Frames of a file, of a folder or of standard input, in real time.

    Parameters
    ----------
    source : Source
        Closed by the feed.
    notify : callable
        Receives a note, on the feed's thread, if reading fails.
    reopen : callable or None
        Opens the source again for `restart`; None if that is impossible.
    every_frame : bool
        Whether each frame waits until it is taken; the clock is then not used.
    stop : callable or None
        Called by `close` to end a source that may block.
    paused : bool
        Whether the feed begins paused, after its first frame.
    """

    def __init__(
        self,
        source: Source,
        notify: Callable[[Note], None],
        *,
        reopen: Callable[[], Source] | None = None,
        every_frame: bool = False,
        stop: Callable[[], None] | None = None,
        paused: bool = False,
    ) -> None:
        super().__init__(source.name, source.size_wh, float(source.fps), source.length)
        self.pixel_aspect = source.info.pixel_aspect
        self.seekable = reopen is not None
        self._notify = notify
        self._reopen = reopen
        self._every_frame = every_frame
        self._stop = stop
        # Number of the current run; a reader of an earlier one notices the difference and ends.
        self._run = 0
        self._paused, self._passes = paused, int(paused)
        self._thread = self._reader_of(source)
        self._thread.start()

    def restart(self, index: int = 0) -> None:
        """Play again from a frame on; while paused, that frame is released.

        The frames before it are decoded and dropped, so that it is the right one in every file.

        Raises
        ------
        CommandError
            The feed is not `seekable`.
        SourceError
            The source cannot be opened again; the current run continues.
        """
        if self._reopen is None:
            super().restart(index)
            return
        source = self._reopen()
        with self._changed:
            self._run += 1
            self.size_wh, self.fps = source.size_wh, float(source.fps)
            self.length = source.length
            self._newest = None
            self._state = "playing"
            self._passes = 1 if self._paused else 0
            self._released_at = time.monotonic()
            self._changed.notify_all()
            self._thread = self._reader_of(source, index)
            self._thread.start()

    def close(self) -> None:
        """Close the source. May be called twice."""
        super().close()
        if self._stop is not None:
            self._stop()
        self._thread.join(_CLOSE_TIMEOUT)

    def _reader_of(self, source: Source, first: int = 0) -> threading.Thread:
        return threading.Thread(
            target=self._read, args=(source, self._run, first), name="ssiam-feed", daemon=True
        )

    def _read(self, source: Source, run: int, first: int) -> None:
        clock = PlayClock(float(source.fps))
        try:
            with source:
                for frame in source:
                    if frame.index < first:
                        if run != self._run or self._closed:
                            return
                        continue
                    if not self._put_when_due(frame, clock, run):
                        return
        except SsiamError as error:
            self._notify(Note("error", str(error)))
        except Exception as error:
            _log.error("reading %s: %s", self.name, stack_of(error))
            text = f"{self.name} cannot be read further ({type(error).__name__}); see the log"
            self._notify(Note("error", text))
        if source.info.undecoded:
            text = f"{source.info.undecoded} frames of {self.name} could not be decoded"
            self._notify(Note("warning", text))
        with self._changed:
            if run == self._run:
                self._state = "ended"
                self._changed.notify_all()

    def _put_when_due(self, frame: Frame, clock: PlayClock, run: int) -> bool:
        """Put the frame when it is due; return False if this run has ended before."""
        with self._changed:
            while run == self._run and not self._closed:
                now = time.monotonic()
                wait = self._seconds_to_wait(frame, clock, now)
                if wait == 0:
                    self._put(frame)
                    return True
                was_paused = self._paused
                self._changed.wait(wait)
                if was_paused:
                    clock.delay(time.monotonic() - now)
            return False

    def _seconds_to_wait(self, frame: Frame, clock: PlayClock, now: float) -> float | None:
        """0 if the frame is due; None to wait for a change of state.

        While paused, one frame is kept ready, so that `advance` does not wait for the decoder.
        """
        if not self._paused and not self._every_frame:
            return max(0.0, clock.seconds_until(frame, now))
        if self._newest is not None:
            return None
        clock.start(frame, now)
        return 0.0
