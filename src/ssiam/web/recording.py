"""`Recordings`: what a live session has been asked to keep, as files to download."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable
from datetime import datetime
from fractions import Fraction
from itertools import count
from pathlib import Path
from typing import Any, Final

from ssiam.errors import SinkError
from ssiam.web.errors import CommandError
from ssiam.web.recorder import FILES, Recorder
from ssiam.web.rota import Rota
from ssiam.web.step import Step

_SQUARE: Final = Fraction(1)
_MOST: Final = 50  # recordings of one session


class Recordings:
    """The recordings of a session, at most one of them open; for any thread.

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
            self._passing = tempfile.TemporaryDirectory(prefix="ssiam-live-")
            folder = Path(self._passing.name)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SinkError(f"{folder} cannot be made: {error.strerror or error}") from error
        self._folder = folder
        self._lock = threading.Lock()
        self._recorders: dict[str, Recorder] = {}
        self._open: Recorder | None = None
        self._changes: Rota[list[dict[str, Any]]] = Rota()

    @property
    def current(self) -> str | None:
        """Name of the open recording."""
        return None if self._open is None else self._open.name

    def begin(self, fps: float, pixel_aspect: Fraction = _SQUARE) -> str:
        """Open a recording of frames that come at about `fps`; its name.

        `pixel_aspect` is the width of a pixel by its height, as players are to show it.

        Raises
        ------
        CommandError
            One is open, or there are too many, or the disk refuses.
        """
        if self._open is not None:
            raise CommandError("not-possible", f"recording {self._open.name} is open: end it first")
        if len(self._recorders) >= _MOST:
            raise CommandError("not-possible", f"there are {_MOST} recordings: start ssiam anew")
        name = self._new_name()
        try:
            recorder = Recorder(self._folder / name, fps, self._tell, pixel_aspect)
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
        if self._open is None:
            raise CommandError("not-possible", "nothing is being recorded")
        recorder, self._open = self._open, None
        recorder.end()
        return recorder.name

    def listing(self) -> list[dict[str, Any]]:
        """All recordings, as the protocol's `recordings` message has them."""
        with self._lock:
            recorders = list(self._recorders.values())
        return [recorder.summary() for recorder in recorders]

    def path(self, name: str, file: str) -> Path:
        """Where a file of a recording lies; `KeyError` if there is none of these names."""
        with self._lock:
            recorder = self._recorders[name]
        if recorder.is_open or file not in FILES or not (recorder.folder / file).exists():
            raise KeyError(file)
        return recorder.folder / file

    def listen(self, listener: Callable[[list[dict[str, Any]]], None]) -> Callable[[], None]:
        """Call `listener` with the listing whenever it changes; what is returned ends it."""
        return self._changes.add(listener)

    def close(self) -> None:
        """End and finish everything. May be called twice."""
        if self._open is not None:
            self.end()
        for recorder in self._recorders.values():
            recorder.join()
        if self._passing is not None:
            self._passing.cleanup()

    def _new_name(self) -> str:
        name = datetime.now().strftime("%Y-%m-%d-%H%M%S")
        tries = (name if n == 1 else f"{name}-{n}" for n in count(1))
        return next(each for each in tries if not (self._folder / each).exists())

    def _tell(self) -> None:
        self._changes.tell(self.listing())
