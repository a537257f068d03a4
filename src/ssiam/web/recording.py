"""`Recordings`: what a live session has been asked to keep, as files to download."""

from __future__ import annotations

import logging
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from fractions import Fraction
from itertools import count
from pathlib import Path
from typing import Any, Final

from ssiam.errors import SinkError, SsiamError, one_line
from ssiam.outputs import make_folder
from ssiam.video import open_source
from ssiam.web.errors import CommandError, Note
from ssiam.web.recorder import Recorder
from ssiam.web.recording_files import TABLES, VIDEO, Facts, RecordingFolder
from ssiam.web.rota import Rota
from ssiam.web.step import Step

_log = logging.getLogger(__name__)

_SQUARE: Final = Fraction(1)
_MOST: Final = 50  # recordings of one session
_MOST_EARLIER: Final = 200  # recordings of earlier sessions that are listed, the newest ones
_PREFIX: Final = "ssiam-live-"  # of the folders whose recordings are gone with their session
_KILLED: Final = "ssiam was killed while it was recorded"


class Recordings:
    """The recordings of a session, at most one of them open; for any thread.

    Those of earlier sessions in the same folder are listed too. One that was being recorded when
    its process was killed is finished on a thread: its exports are written.

    Parameters
    ----------
    folder : Path, optional
        Where they are kept, each in a folder of its own. Without it they are gone with the
        session.

    Raises
    ------
    SinkError
        The folder cannot be made.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._passing = None
        if folder is None:
            self._passing = tempfile.TemporaryDirectory(prefix=_PREFIX)
            folder = Path(self._passing.name)
            self._in_use = RecordingFolder(folder)
            self._in_use.lock()
        make_folder(folder)
        self._folder = folder
        self._lock = threading.Lock()
        self._recorders: dict[str, Recorder] = {}
        self._open: Recorder | None = None
        self._changes: Rota[list[dict[str, Any]]] = Rota()
        self._notes: Rota[Note] = Rota()
        self._closing = threading.Event()
        self._earlier = {} if self._passing else _earlier(folder)
        self._thread = threading.Thread(
            target=self._finish_earlier, name="ssiam-recordings", daemon=True
        )
        if any(facts is None or not facts.whole for _, facts in self._earlier.values()):
            self._thread.start()

    @property
    def current(self) -> str | None:
        """Name of the open recording."""
        recorder = self._open
        return recorder.name if recorder is not None and recorder.is_open else None

    def begin(self, fps: float, pixel_aspect: Fraction = _SQUARE) -> str:
        """Open a recording of frames that come at about `fps`; its name.

        `pixel_aspect` is the width of a pixel by its height, as players are to show it.

        Raises
        ------
        CommandError
            One is open, or there are too many, or the disk refuses.
        """
        if self.current is not None:
            raise CommandError("not-possible", f"recording {self.current} is open: end it first")
        if len(self._recorders) >= _MOST:
            raise CommandError("not-possible", f"there are {_MOST} recordings: start ssiam anew")
        name = self._new_name()
        try:
            recorder = Recorder(
                self._folder / name, fps, self._tell, self._notes.tell, pixel_aspect
            )
        except SinkError as error:
            raise CommandError("not-possible", str(error)) from error
        with self._lock:
            self._recorders[name] = recorder
        self._open = recorder
        self._tell()
        return name

    def write(self, step: Step) -> None:
        """Add a step to the open recording, if there is one; returns at once."""
        if self._open is not None and not self._open.write(step):
            self._open = None

    def end(self) -> str:
        """Close the open recording; its name. `CommandError` if none is open."""
        recorder, self._open = self._open, None
        if recorder is None or not recorder.is_open:
            raise CommandError("not-possible", "nothing is being recorded")
        recorder.end()
        return recorder.name

    def listing(self) -> list[dict[str, Any]]:
        """All recordings, as the protocol's `recordings` message has them."""
        with self._lock:
            earlier = list(self._earlier.values())
            recorders = list(self._recorders.values())
        listed = [
            folder.summary(facts or Facts("30"), is_open=facts is None or not facts.whole)
            for folder, facts in earlier
        ]
        return [*listed, *(recorder.summary() for recorder in recorders)]

    def path(self, name: str, file: str) -> Path:
        """Where a file of a recording lies; `KeyError` if there is none of these names."""
        with self._lock:
            recorder, earlier = self._recorders.get(name), self._earlier.get(name)
        if recorder is not None:
            path = recorder.path(file)
        elif earlier is not None and earlier[1] is not None and earlier[1].whole:
            path = earlier[0].path / file if file in earlier[0].files else None
        else:
            path = None
        if path is None:
            raise KeyError(file)
        return path

    def listen(self, listener: Callable[[list[dict[str, Any]]], None]) -> Callable[[], None]:
        """Call `listener` with the listing whenever it changes; what is returned ends it."""
        return self._changes.add(listener)

    def notes(self, listener: Callable[[Note], None]) -> Callable[[], None]:
        """Call `listener` with each message for people; what is returned ends it."""
        return self._notes.add(listener)

    def close(self) -> None:
        """End and finish everything. May be called twice."""
        self._closing.set()
        with suppress(CommandError):
            self.end()
        for recorder in self._recorders.values():
            recorder.join()
        if self._thread.is_alive():
            self._thread.join()
        if self._passing is not None:
            self._in_use.unlock()
            self._passing.cleanup()

    def _new_name(self) -> str:
        name = datetime.now().strftime("%Y-%m-%d-%H%M%S")
        tries = (name if n == 1 else f"{name}-{n}" for n in count(1))
        return next(each for each in tries if not (self._folder / each).exists())

    def _tell(self) -> None:
        self._changes.tell(self.listing())

    def _finish_earlier(self) -> None:
        """Finish what earlier processes left open, unless another one is still recording it."""
        for name, (folder, facts) in list(self._earlier.items()):
            if self._closing.is_set():
                return
            if (facts is not None and facts.whole) or not folder.lock():
                continue
            try:
                whole = _finished(folder, facts)
            except Exception as error:
                whole = replace(facts or Facts("30"), whole=True, error=one_line(error))
                _log.exception("recording %s of an earlier session", name)
            finally:
                folder.unlock()
            with self._lock:
                self._earlier[name] = folder, whole
            self._tell()


def left_behind() -> list[Path]:
    """Folders with recordings that were to be gone with their session, which was killed."""
    found = []
    for path in sorted(Path(tempfile.gettempdir()).glob(f"{_PREFIX}*")):
        folder = RecordingFolder(path)
        with suppress(OSError):
            if any(path.iterdir()) and _earlier(path) and folder.lock():
                folder.unlock()
                found.append(path)
    return found


def _earlier(path: Path) -> dict[str, tuple[RecordingFolder, Facts | None]]:
    """The recordings in a folder and their facts, None where they have none."""
    found = {}
    try:
        names = sorted(each.name for each in path.iterdir() if each.is_dir())
    except OSError as error:
        _log.warning("%s cannot be read: %s", path, error)
        return {}
    for name in names[-_MOST_EARLIER:]:
        folder = RecordingFolder(path / name)
        facts = folder.read_facts()
        if facts is not None or {VIDEO, TABLES[0]} <= set(folder.files):
            found[name] = folder, facts
    return found


def _finished(folder: RecordingFolder, facts: Facts | None) -> Facts:
    """Finish a recording whose process was killed; one without facts is of an earlier version."""
    if facts is not None:
        return folder.finish(replace(facts, error=_KILLED))
    try:
        with open_source(str(folder.path / VIDEO)) as frames:
            rate, size_wh, length = frames.fps, frames.size_wh, frames.length
    except SsiamError as error:
        return Facts("30", whole=True, error=one_line(error))
    count = length or 0
    return Facts(str(rate), size_wh, count, count / float(rate), whole=True)
