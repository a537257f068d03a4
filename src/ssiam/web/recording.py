"""`Recordings`: videos and result tables of a live session, as files to download."""

from __future__ import annotations

import logging
import tempfile
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import replace
from datetime import datetime
from fractions import Fraction
from itertools import count
from pathlib import Path
from time import monotonic
from typing import Any, Final

from ssiam.errors import SinkError, SsiamError, one_line
from ssiam.outputs import make_folder
from ssiam.video import ResultSink, VideoSink, draw_tracks, open_results
from ssiam.video.results import Row
from ssiam.web.events import Listeners, StepQueue
from ssiam.web.recording_files import (
    TABLES,
    TEMPORARY_PREFIX,
    UNKNOWN_RATE,
    VIDEO,
    RecordingFolder,
    RecordingMetadata,
    earlier_recordings,
)
from ssiam.web.types import CommandError, Note, Step

_log = logging.getLogger(__name__)

_SQUARE: Final = Fraction(1)
_MAX_RECORDINGS: Final = 50  # of one session
_MAX_FRAMES: Final = 30 * 60 * 60  # of one recording: an hour at 30 frames per second
_SAVE_INTERVAL: Final = 1.0  # seconds between two writes of the metadata


class Recordings:
    """The recordings of a session. At most one is open. Safe to use from any thread.

    Recordings of earlier sessions in the same folder are listed too. Those whose process was
    killed are finished on a background thread: their exports are written.

    Parameters
    ----------
    folder : Path, optional
        Each recording gets a folder in it. Without it, recordings are deleted with the session;
        until then only their owner can read them.

    Raises
    ------
    SinkError
        The folder cannot be created.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._temporary: tuple[tempfile.TemporaryDirectory[str], RecordingFolder] | None = None
        if folder is None:
            directory = tempfile.TemporaryDirectory(prefix=TEMPORARY_PREFIX)
            folder = Path(directory.name)
            self._temporary = directory, RecordingFolder(folder)
            self._temporary[1].lock()
        make_folder(folder)
        self._folder = folder
        self._lock = threading.Lock()
        self._recorders: dict[str, _Recorder] = {}
        self._open: _Recorder | None = None
        self._changes: Listeners[list[dict[str, Any]]] = Listeners()
        self._notes: Listeners[Note] = Listeners()
        self._closing = threading.Event()
        self._earlier = {} if self._temporary else earlier_recordings(folder)
        self._thread = threading.Thread(
            target=self._finish_earlier, name="ssiam-recordings", daemon=True
        )
        if any(data is None or not data.is_finished for _, data in self._earlier.values()):
            self._thread.start()

    @property
    def current(self) -> str | None:
        """Name of the open recording."""
        recorder = self._open
        return recorder.name if recorder is not None and recorder.is_open else None

    def begin(self, fps: float, pixel_aspect: Fraction = _SQUARE) -> str:
        """Start a recording.

        Parameters
        ----------
        fps : float
            Approximate frames per second.
        pixel_aspect : Fraction
            Width of a pixel divided by its height, for players.

        Returns
        -------
        str
            Name of the recording.

        Raises
        ------
        CommandError
            A recording is open, there are too many, or the files cannot be created.
        """
        if self.current is not None:
            raise CommandError("not-possible", f"recording {self.current} is open: stop it first")
        if len(self._recorders) >= _MAX_RECORDINGS:
            text = f"there are {_MAX_RECORDINGS} recordings: restart ssiam to record more"
            raise CommandError("not-possible", text)
        name = self._new_name()
        try:
            recorder = _Recorder(
                self._folder / name, fps, pixel_aspect, self._notify_changes, self._notes.notify
            )
        except SinkError as error:
            raise CommandError("not-possible", str(error)) from error
        with self._lock:
            self._recorders[name] = recorder
        self._open = recorder
        self._notify_changes()
        return name

    def write(self, step: Step) -> None:
        """Add a step to the open recording, if there is one, without blocking."""
        if self._open is not None and not self._open.write(step):
            self._open = None

    def end(self) -> str:
        """Stop the open recording; returns its name. `CommandError` if none is open."""
        recorder, self._open = self._open, None
        if recorder is None or not recorder.is_open:
            raise CommandError("not-possible", "no recording is open")
        recorder.end()
        return recorder.name

    def listing(self) -> list[dict[str, Any]]:
        """All recordings, as in the protocol's `recordings` message."""
        with self._lock:
            earlier = list(self._earlier.values())
            recorders = list(self._recorders.values())
        listed = [
            folder.summary(
                metadata or RecordingMetadata(UNKNOWN_RATE),
                is_open=metadata is None or not metadata.is_finished,
            )
            for folder, metadata in earlier
        ]
        return [*listed, *(recorder.summary() for recorder in recorders)]

    def path(self, name: str, file: str) -> Path:
        """Path of a file of a finished recording; `KeyError` if there is no such file."""
        with self._lock:
            recorder, earlier = self._recorders.get(name), self._earlier.get(name)
        if recorder is not None:
            path = recorder.path(file)
        elif earlier is not None and earlier[1] is not None and earlier[1].is_finished:
            path = earlier[0].path / file if file in earlier[0].files else None
        else:
            path = None
        if path is None:
            raise KeyError(file)
        return path

    def listen(self, listener: Callable[[list[dict[str, Any]]], None]) -> Callable[[], None]:
        """Call `listener` with the listing when it changes; return a function that removes it."""
        return self._changes.add(listener)

    def listen_notes(self, listener: Callable[[Note], None]) -> Callable[[], None]:
        """Call `listener` with each note; return a function that removes it."""
        return self._notes.add(listener)

    def close(self) -> None:
        """Stop and finish all recordings. May be called twice."""
        self._closing.set()
        with suppress(CommandError):
            self.end()
        for recorder in self._recorders.values():
            recorder.join()
        if self._thread.is_alive():
            self._thread.join()
        if self._temporary is not None:
            directory, folder = self._temporary
            folder.unlock()
            directory.cleanup()

    def _new_name(self) -> str:
        name = datetime.now().strftime("%Y-%m-%d-%H%M%S")
        names = (name if n == 1 else f"{name}-{n}" for n in count(1))
        return next(each for each in names if not (self._folder / each).exists())

    def _notify_changes(self) -> None:
        self._changes.notify(self.listing())

    def _finish_earlier(self) -> None:
        """Finish the recordings of killed processes; running processes hold a lock on theirs."""
        for name, (folder, metadata) in list(self._earlier.items()):
            if self._closing.is_set():
                return
            if (metadata is not None and metadata.is_finished) or not folder.lock():
                continue
            try:
                finished = folder.finish_after_crash(metadata)
            except Exception as error:
                unfinished = metadata or RecordingMetadata(UNKNOWN_RATE)
                finished = replace(unfinished, is_finished=True, error=one_line(error))
                _log.exception("recording %s of an earlier session", name)
            finally:
                folder.unlock()
            with self._lock:
                self._earlier[name] = folder, finished
            self._notify_changes()


class _Recorder:
    """Writes steps as a video with the targets drawn in, and as tables, on its own thread.

    Frames are numbered as in the video. A frame that several steps repeat, for example while the
    source is paused, is written once. A recording that ends early, because the disk is full or the
    frame size changes, is finished like any other.

    Parameters
    ----------
    folder : Path
        Created for the recording.
    fps : float
        For frames without a time.
    pixel_aspect : Fraction
        Width of a pixel divided by its height, for players.
    finished : callable
        Called when the recording is finished.
    notify : callable
        Receives a note if the recording ends early or lacks files.

    Raises
    ------
    SinkError
        The folder or a file in it cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        fps: float,
        pixel_aspect: Fraction,
        finished: Callable[[], None],
        notify: Callable[[Note], None],
    ) -> None:
        make_folder(folder, exist_ok=False)
        self._folder, self.name = RecordingFolder(folder), folder.name
        self.is_open = True
        self._finished, self._notify = finished, notify
        fraction = Fraction(fps or 30).limit_denominator(1001)
        self._metadata = RecordingMetadata(str(fraction))
        self._saved_at = 0.0
        self._end_requested = False
        self._queue = StepQueue()
        self._thread = threading.Thread(target=self._run, name="ssiam-recorder", daemon=True)
        with ExitStack() as lock, ExitStack() as sinks:
            self._folder.lock()
            lock.callback(self._folder.unlock)
            self._folder.write_metadata(self._metadata)
            self._video = sinks.enter_context(
                VideoSink(folder / VIDEO, fraction, pixel_aspect=pixel_aspect)
            )
            self._tables: list[ResultSink] = [
                sinks.enter_context(open_results(folder / name)) for name in TABLES
            ]
            self._sinks, self._lock = sinks.pop_all(), lock.pop_all()
        self._thread.start()

    def write(self, step: Step) -> bool:
        """Queue a step without blocking; False if the recording has ended."""
        if not self.is_open or self._metadata.frames >= _MAX_FRAMES:
            self._queue.close()
            return False
        if not self._queue.put(step):
            _log.warning("recording %s: a frame is dropped, the disk is too slow", self.name)
        return True

    def end(self) -> None:
        """Finish the recording after the queued steps, without blocking."""
        self._end_requested = True
        self._queue.close()

    def join(self) -> None:
        """Wait until everything is written."""
        self._thread.join()

    def summary(self) -> dict[str, Any]:
        """The entry of the protocol's `recordings` message."""
        return self._folder.summary(self._metadata, is_open=self.is_open)

    def path(self, file: str) -> Path | None:
        """Path of a file; None if it does not exist or the recording is open."""
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
            self._metadata = self._folder.finish(replace(self._metadata, error=error))
        self.is_open = False
        self._queue.clear()
        if self._metadata.error:
            text = f"recording {self.name} ended early: {self._metadata.error}; the rest is kept"
            if self._end_requested:
                text = f"recording {self.name} is incomplete: {self._metadata.error}"
            _log.info("%s", text)
            self._notify(Note("error", text))
        self._finished()

    def _write_all(self) -> str:
        """Write all steps; return why the recording ends early, or ""."""
        for step in self._queue:
            height, width = step.frame.image.shape[:2]
            before = self._metadata.size_wh
            if self._metadata.frames and (width, height) != before:
                return (
                    f"the frame size changed from {before[0]}x{before[1]} to {width}x{height} "
                    "pixels"
                )
            self._write_step(step, (width, height))
        if self._metadata.frames >= _MAX_FRAMES and not self._end_requested:
            return f"it has {_MAX_FRAMES} frames, the maximum"
        return ""

    def _write_step(self, step: Step, size_wh: tuple[int, int]) -> None:
        frame, targets = step.frame, step.targets
        tracks = [target.track for target in targets]
        drawn = draw_tracks(frame.image, tracks, numbers=[target.id for target in targets])
        # Times are those of the recorded video, not of the session.
        time = self._video.write(drawn, frame.time)
        for target in targets:
            row = Row(self._metadata.frames, time, target.id, target.track)
            for table in self._tables:
                table.write_row(row)
        self._metadata = replace(
            self._metadata,
            size_wh=size_wh,
            frames=self._metadata.frames + 1,
            seconds=(time or 0.0) + 1 / float(self._metadata.rate),
            names={**self._metadata.names, **{str(target.id): target.name for target in targets}},
        )
        if monotonic() - self._saved_at >= _SAVE_INTERVAL:
            self._saved_at = monotonic()
            with suppress(SinkError):
                self._folder.write_metadata(self._metadata)
