"""`ssiam live --headless`: a session that starts, runs and ends without a person."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

from ssiam.cli.moments import PlannedTarget
from ssiam.errors import ArgumentError, IncompleteError, SourceError
from ssiam.web import Add, Note, Session, Step
from ssiam.web.output_files import OutputFiles

_POLL: Final = 0.5  # seconds between two attempts to open a source
_CHECK_INTERVAL: Final = 0.2  # seconds between two checks of a running session
# Seconds since the last change after which a file counts as complete. Its end cannot be known.
_QUIET: Final = 2.0


def open_when_there(
    open_session: Callable[[], Session], source: str, notify: Callable[[str], None]
) -> Session:
    """Open a session as soon as its source can be opened.

    Parameters
    ----------
    open_session : callable
        Raises `SourceError` as long as there is no source.
    source : str
        As in `open_feed`. A file that was changed within the last seconds is waited for, too.
    notify : callable
        Receives one line at most, when waiting begins.

    Raises
    ------
    SsiamError
        Any other error of `open_session`.
    """
    is_waiting = False
    while True:
        reason = f"{source}: is still being written" if _is_changing(source) else ""
        if not reason:
            try:
                return open_session()
            except SourceError as error:
                reason = str(error)
        if not is_waiting:
            notify(f"waiting for the source: {reason}")
            is_waiting = True
        time.sleep(_POLL)


def _is_changing(source: str) -> bool:
    with suppress(OSError):
        path = Path(source)
        return path.is_file() and 0 <= time.time() - path.stat().st_mtime < _QUIET
    return False


class InitialTargets:
    """Adds the targets of ``--box`` to a session at its first frame.

    Parameters
    ----------
    session : Session
        Not started yet.
    targets : sequence of PlannedTarget
        That begin at no given time; otherwise `ArgumentError`.
    notify : bool
        Whether a refused target is a note of the session, for people who watch it; otherwise call
        `check`.
    """

    def __init__(
        self, session: Session, targets: Sequence[PlannedTarget], *, notify: bool = False
    ) -> None:
        for target in targets:
            if target.begins is not None:
                raise ArgumentError(
                    f"{target.label} begins at a later time, but a live source has no timeline: "
                    "give the box of the first frame, x,y,width,height"
                )
        self._session, self._targets, self._notify = session, targets, notify
        self._answers: list[Future[Any]] = []
        self._unlisten = session.listen(self._add)

    def _add(self, step: Step) -> None:
        self._unlisten()
        self._answers = [
            self._session.submit(Add(target.xywh, step.number)) for target in self._targets
        ]
        for target, answer in zip(self._targets, self._answers, strict=True):
            answer.add_done_callback(partial(self._report, target))

    def _report(self, target: PlannedTarget, answer: Future[Any]) -> None:
        error = answer.exception()
        if error is not None and self._notify:
            self._session.notify(Note("error", f"{target.label}: {error}"))

    def check(self) -> None:
        """Raise the `SsiamError` of a target that was refused."""
        for target, answer in zip(self._targets, self._answers, strict=False):
            error = answer.exception() if answer.done() else None
            if error is not None:
                raise ArgumentError(f"{target.label}: {error}")


def run_headless(session: Session, targets: InitialTargets, outputs: OutputFiles | None) -> None:
    """Run a started session until its source ends, or until Ctrl-C.

    Raises
    ------
    IncompleteError
        Tracking has failed.
    Exception
        A target was refused, or an output cannot be written further.
    """
    with suppress(KeyboardInterrupt):
        while session.newest is None or session.newest.playback != "ended":
            targets.check()
            if outputs is not None and outputs.error is not None:
                raise outputs.error
            if session.health.state == "failed":
                raise IncompleteError(session.health.message)
            time.sleep(_CHECK_INTERVAL)
        targets.check()
