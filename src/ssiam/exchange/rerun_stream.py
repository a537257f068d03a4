"""`RerunStream`: what one recording of Rerun needs of its SDK, in any of its versions from 0.20."""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from threading import Thread
from typing import Any, Final

from ssiam.errors import MissingExtraError, SinkError
from ssiam.outputs import PartFile

_APPLICATION: Final = "ssiam"
_PIPES: Final = Path("/dev/fd")
_PIECE: Final = 1 << 20  # bytes


class RerunStream:
    """A recording that goes into an .rrd file, and nowhere else: no viewer, no network.

    Parameters
    ----------
    path : Path
        The file. It grows as ``NAME.part.rrd``, which `close` renames.
    overwrite : bool
        Whether a file of that name may be replaced.

    Raises
    ------
    MissingExtraError
        The SDK is not installed.
    SinkError
        On construction, logging or closing: the file cannot be written, or exists and is not to
        be replaced.
    """

    def __init__(self, path: Path, *, overwrite: bool = True) -> None:
        try:
            self.rr: Any = importlib.import_module("rerun")
        except ImportError as error:
            raise MissingExtraError(
                f"a recording for Rerun needs its SDK ({error}): pip install 'ssiam[rerun]'"
            ) from error
        if path.suffix.lower() != ".rrd":
            raise SinkError(f"{path}: a recording for Rerun is written as .rrd")
        self._part = PartFile(path, overwrite=overwrite)
        # In 0.23 several names changed at once.
        self._is_recent = hasattr(self.rr, "Scalars")
        begin = self.rr.RecordingStream if self._is_recent else self.rr.new_recording
        self._recording: Any = begin(_APPLICATION)
        self._copy = _Copy(self._part.file) if _PIPES.is_dir() else None
        self._save()

    def at(self, frame: int, time: float | None) -> None:
        """The time of all that is logged from now on: frame from 0, seconds if known."""
        self._recording.reset_time()
        if self._is_recent:
            self._recording.set_time("frame", sequence=frame)
            if time is not None:
                self._recording.set_time("time", duration=time)
            return
        self._recording.set_time_sequence("frame", frame)
        if time is not None:
            self._recording.set_time_seconds("time", time)

    def log(self, entity: str, value: Any) -> None:
        """Log one of the SDK's archetypes (`rr`) under the path `entity`."""
        if self._copy is not None and self._copy.error is not None:
            raise self._part.error(self._copy.error) from self._copy.error
        self._recording.log(entity, value, strict=True)

    def log_number(self, entity: str, value: float) -> None:
        """Log a number that is plotted over time."""
        self.log(entity, (self.rr.Scalars if self._is_recent else self.rr.Scalar)(value))

    def close(self) -> None:
        """Finish the file. May be called twice."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        recording.disconnect()
        if self._copy is not None:
            self._copy.finish()
            if self._copy.error is not None:
                raise self._part.error(self._copy.error) from self._copy.error
        try:
            self._part.finish()
        except OSError as error:
            raise self._part.error(error) from error

    def _save(self) -> None:
        try:
            self._recording.save(str(self._part.file if self._copy is None else self._copy.entry))
        except RuntimeError as error:
            self._part.discard()
            raise self._part.error(error) from error
        finally:
            if self._copy is not None:
                self._copy.opened()


class _Copy:
    """A pipe whose bytes a thread writes to a file.

    The SDK tells nobody when its own writing fails, and hangs from then on: a full disk would
    stop the program that records. A pipe never fails.
    """

    def __init__(self, path: Path) -> None:
        self._source, self._sink = os.pipe()
        self.entry = _PIPES / str(self._sink)
        self.error: OSError | None = None
        self._thread = Thread(target=self._run, args=(path,), name="rerun-file", daemon=True)
        self._thread.start()

    def opened(self) -> None:
        """The SDK has its own end of the pipe by now; the pipe ends with it."""
        os.close(self._sink)

    def finish(self) -> None:
        """Wait until everything is in the file."""
        self._thread.join()

    def _run(self, path: Path) -> None:
        try:
            with path.open("wb") as file:
                while piece := os.read(self._source, _PIECE):
                    file.write(piece)
        except OSError as error:
            self.error = error
        while os.read(self._source, _PIECE):
            pass
        os.close(self._source)
