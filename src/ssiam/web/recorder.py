"""`Recorder`: one recording, written on a thread of its own."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from time import monotonic
from typing import Any, Final

from ssiam.errors import SinkError, SsiamError, one_line
from ssiam.outputs import output_error
from ssiam.video import ResultSink, VideoSink, draw_tracks, open_results
from ssiam.video.layouts import Row
from ssiam.web.backlog import Backlog
from ssiam.web.errors import Note
from ssiam.web.recording_files import TABLES, VIDEO, Facts, RecordingFolder
from ssiam.web.step import Step

_log = logging.getLogger(__name__)

_SQUARE: Final = Fraction(1)
_LONGEST: Final = 30 * 60 * 60  # frames: an hour at 30 a second
_SAVED: Final = 1.0  # seconds between two writes of what is lost if the process is killed


class Recorder:
    """Writes steps as a video with the targets drawn in, and as results.

    Frames are numbered as they are in the video. A frame that is told of twice, as while the
    source is paused, is written once. A recording that ends by itself, because the disk is full
    or the frames have another size, is finished as one that is ended: with its exports.

    Parameters
    ----------
    folder : Path
        Made for it.
    fps : float
        Of frames that have no time.
    changed : callable
        Called when the recording is complete.
    note : callable
        Told why it has ended by itself.
    pixel_aspect : Fraction
        Width of a pixel by its height, as players are to show it.

    Raises
    ------
    SinkError
        The folder or a file in it cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        fps: float,
        changed: Callable[[], None],
        note: Callable[[Note], None],
        pixel_aspect: Fraction = _SQUARE,
    ) -> None:
        try:
            folder.mkdir()
        except OSError as error:
            raise output_error(folder, error) from error
        self._folder, self.name = RecordingFolder(folder), folder.name
        self.is_open = True
        self._changed, self._note = changed, note
        fraction = Fraction(fps or 30).limit_denominator(1001)
        self._facts = Facts(str(fraction))
        self._saved = 0.0
        self._asked_to_end = False
        self._backlog = Backlog()
        self._thread = threading.Thread(target=self._run, name="ssiam-recorder", daemon=True)
        with ExitStack() as lock, ExitStack() as sinks:
            self._folder.lock()
            lock.callback(self._folder.unlock)
            self._folder.write_facts(self._facts)
            self._video = sinks.enter_context(
                VideoSink(folder / VIDEO, fraction, pixel_aspect=pixel_aspect)
            )
            self._tables: list[ResultSink] = [
                sinks.enter_context(open_results(folder / name)) for name in TABLES
            ]
            self._sinks, self._lock = sinks.pop_all(), lock.pop_all()
        self._thread.start()

    def write(self, step: Step) -> bool:
        """Take in a step, at once; False when no more can be taken and the recording has ended."""
        if not self.is_open or self._facts.frames >= _LONGEST:
            self._backlog.end()
            return False
        if not self._backlog.add(step):
            _log.warning("recording %s: a frame is left out, the disk is too slow", self.name)
        return True

    def end(self) -> None:
        """Let the thread finish what it has."""
        self._asked_to_end = True
        self._backlog.end()

    def join(self) -> None:
        """Wait until everything is written."""
        self._thread.join()

    def summary(self) -> dict[str, Any]:
        """Name, frames, seconds, whether it is open, its files."""
        return self._folder.summary(self._facts, is_open=self.is_open)

    def path(self, file: str) -> Path | None:
        """Where a file lies; None if there is none of this name, or the recording is open."""
        if self.is_open or file not in self._folder.files:
            return None
        return self._folder.path / file

    def _run(self) -> None:
        error = ""
        try:
            with self._sinks:
                error = self._write_all()
        except Exception as failure:
            error = one_line(failure)
            if not isinstance(failure, SsiamError):
                _log.exception("recording %s", self.name)
        with self._lock:
            self._facts = self._folder.finish(replace(self._facts, error=error))
        self.is_open = False
        self._backlog.clear()
        if self._facts.error:
            text = f"recording {self.name} has ended: {self._facts.error}; the rest is kept"
            if self._asked_to_end:
                text = f"recording {self.name} is not whole: {self._facts.error}"
            _log.info("%s", text)
            self._note(Note("error", text))
        self._changed()

    def _write_all(self) -> str:
        """Write what comes until the end; why that came by itself, or ""."""
        for step in self._backlog:
            height, width = step.frame.image.shape[:2]
            before = self._facts.size_wh
            if self._facts.frames and (width, height) != before:
                return f"frames have {width}x{height} pixels now, not {before[0]}x{before[1]}"
            self._add(step, (width, height))
        if self._facts.frames >= _LONGEST and not self._asked_to_end:
            return f"it has {_LONGEST} frames, and no recording has more"
        return ""

    def _add(self, step: Step, size_wh: tuple[int, int]) -> None:
        frame, targets = step.frame, step.targets
        tracks = [target.track for target in targets]
        drawn = draw_tracks(frame.image, tracks, numbers=[target.id for target in targets])
        # Times are those of the recorded video, not of the session.
        time = self._video.write(drawn, frame.time)
        for target in targets:
            row = Row(self._facts.frames, time, target.id, target.track)
            for table in self._tables:
                table.write_row(row)
        names = {**self._facts.names, **{str(target.id): target.name for target in targets}}
        frames, seconds = self._facts.frames + 1, (time or 0.0) + 1 / float(self._facts.rate)
        self._facts = replace(
            self._facts, size_wh=size_wh, frames=frames, seconds=seconds, names=names
        )
        if monotonic() - self._saved >= _SAVED:
            self._saved = monotonic()
            with suppress(SinkError):
                self._folder.write_facts(self._facts)
