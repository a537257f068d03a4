"""`RerunTap`: a live session's steps into a file for the Rerun viewer."""

from __future__ import annotations

import threading
from pathlib import Path

from ssiam.exchange import RerunLog
from ssiam.web.backlog import Backlog
from ssiam.web.session import Session
from ssiam.web.step import Step
from ssiam.web.troubles import Troubles


class RerunTap:
    """Logs each frame of a session once, on a thread of its own; a context manager.

    Parameters
    ----------
    session : Session
    path : Path
        A .rrd file.
    overwrite : bool
        Whether a file of that name may be replaced.

    Raises
    ------
    SinkError
        The file cannot be written, or exists and is not to be replaced.
    MissingExtraError
        rerun-sdk is not installed.
    """

    def __init__(self, session: Session, path: Path, *, overwrite: bool = True) -> None:
        self._sink = RerunLog(path, overwrite=overwrite)
        self._troubles = Troubles(session.say)
        self._backlog = Backlog()
        self._thread = threading.Thread(target=self._run, name="ssiam-rerun", daemon=True)
        self._thread.start()
        self._unlisten = session.listen(self._backlog.add)

    def close(self) -> None:
        """Finish the file. May be called twice."""
        self._unlisten()
        self._backlog.end()
        self._thread.join()

    def __enter__(self) -> RerunTap:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _run(self) -> None:
        try:
            with self._sink as log:
                for step in self._backlog:
                    self._write(log, step)
        except Exception as error:
            self._troubles.tell("the Rerun file has ended", error)
            for _ in self._backlog:
                pass  # frames are not held for a file that takes none

    @staticmethod
    def _write(log: RerunLog, step: Step) -> None:
        tracks = [target.track for target in step.targets]
        names = [target.name for target in step.targets]
        ids = [target.id for target in step.targets]
        log.write(step.number, step.frame.time, step.frame.image, tracks, names, ids)
