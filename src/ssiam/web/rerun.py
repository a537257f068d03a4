"""`RerunRecorder`: writes a live session's steps to a file for the Rerun viewer."""

from __future__ import annotations

import threading
from pathlib import Path

from ssiam.exchange import RerunLog
from ssiam.web.events import StepQueue
from ssiam.web.monitoring import ErrorReporter
from ssiam.web.session import Session
from ssiam.web.types import Step


class RerunRecorder:
    """Logs each frame of a session once, on a separate thread. A context manager.

    Parameters
    ----------
    session : Session
    path : Path
        A .rrd file.
    overwrite : bool
        Whether an existing file is replaced.

    Raises
    ------
    SinkError
        The file cannot be written, or exists and `overwrite` is False.
    MissingExtraError
        rerun-sdk is not installed.
    """

    def __init__(self, session: Session, path: Path, *, overwrite: bool = True) -> None:
        self._sink = RerunLog(path, overwrite=overwrite)
        self._errors = ErrorReporter(session.notify)
        self._queue = StepQueue()
        self._thread = threading.Thread(target=self._run, name="ssiam-rerun", daemon=True)
        self._thread.start()
        self._unlisten = session.listen(self._queue.put)

    def close(self) -> None:
        """Finish the file. May be called twice."""
        self._unlisten()
        self._queue.close()
        self._thread.join()

    def __enter__(self) -> RerunRecorder:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _run(self) -> None:
        try:
            with self._sink as log:
                for step in self._queue:
                    self._write(log, step)
        except Exception as error:
            self._errors.report("the Rerun file has ended", error)
            for _ in self._queue:
                pass  # empties the queue, which would keep frames in memory

    @staticmethod
    def _write(log: RerunLog, step: Step) -> None:
        tracks = [target.track for target in step.targets]
        names = [target.name for target in step.targets]
        ids = [target.id for target in step.targets]
        log.write(step.number, step.frame.time, step.frame.image, tracks, names, ids)
