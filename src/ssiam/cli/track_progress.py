"""`RunProgress`: what a tracking run reports while it runs; and the bar on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as RichProgress


class RunProgress(Protocol):
    """Receives the progress of a tracking run, in the thread that tracks."""

    def advance(self, done: int, total: int | None, fps: float | None) -> None:
        """Report a finished frame.

        Parameters
        ----------
        done : int
            Frames written so far. With ``--backward``, or a view that is planned for the whole
            clip, each frame counts twice: when it is tracked, and when it is written.
        total : int or None
            Expected value of `done` at the end, which may be wrong; None if it is unknown.
        fps : float or None
            Recent frames per second of the tracking alone; None before the first tracked frame.
        """

    def finished(self, written: Sequence[tuple[str, Path]]) -> None:
        """Report the end, also of a run that failed or was interrupted.

        Parameters
        ----------
        written : sequence of (str, Path)
            Kind ("video", "results", "plot") and location of each output, under its final name
            unless it could not be finished.
        """


class TerminalProgress:
    """A progress bar on standard error, if that is a terminal; gone after `finished`."""

    def __init__(self, *, quiet: bool = False) -> None:
        console = Console(file=sys.stderr)
        self._bar = RichProgress(
            TextColumn("tracking"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[speed]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            redirect_stdout=False,  # which may carry results
            redirect_stderr=False,
            disable=quiet or not console.is_terminal,
        )
        self._task = self._bar.add_task("tracking", total=None, speed="")

    def advance(self, done: int, total: int | None, fps: float | None) -> None:
        """Move the bar."""
        self._bar.start()
        speed = "" if fps is None else f"{fps:.0f} fps"
        self._bar.update(self._task, completed=done, total=total, speed=speed)

    def finished(self, written: Sequence[tuple[str, Path]]) -> None:
        """Remove the bar."""
        self._bar.stop()
