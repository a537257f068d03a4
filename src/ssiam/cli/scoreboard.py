"""What `ssiam bench` tells: a live table while it runs, and the same one at the end."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.table import Table

from ssiam.errors import SsiamError
from ssiam.evaluation.bench import Done, Task

_FILE_WIDTH = 120  # characters of the table where it does not go to a terminal


class RunsFailedError(SsiamError):
    """Some runs of a benchmark have no result; the others are kept."""


class Scoreboard:
    """One row for each tracker, on standard error while the runs go on."""

    def __init__(self, todo: Sequence[Task]) -> None:
        self._total: dict[str, int] = {}
        for task in todo:
            self._total[task.entry.label] = self._total.get(task.entry.label, 0) + 1
        self._done: dict[str, list[Done]] = {label: [] for label in self._total}
        console = Console(file=sys.stderr)
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._shown = console.is_terminal

    def __enter__(self) -> Scoreboard:
        if self._shown:
            self._live.start()
        return self

    def __exit__(self, *exc: object) -> None:
        if self._shown:
            self._live.stop()

    def add(self, done: Done) -> None:
        """A run has ended."""
        self._done[done.label].append(done)
        if self._shown:
            self._live.update(self._table(), refresh=True)

    def show(self, out: Path) -> None:
        """Print the table.

        Raises
        ------
        RunsFailedError
            Some runs failed; the message tells of the first one.
        """
        width = None if sys.stdout.isatty() else _FILE_WIDTH
        Console(width=width).print(self._table())
        print(f"results: {out}")
        failed = [done for runs in self._done.values() for done in runs if done.failed]
        if failed:
            first = failed[0]
            raise RunsFailedError(
                f"{len(failed)} of {sum(self._total.values())} runs have no result; the first: "
                f"{first.label} on {first.sequence}: {first.failed}"
            )

    def _table(self) -> Table:
        table = Table("tracker", "sequences", "lost", "overlap", "frames a second")
        for label, runs in self._done.items():
            good = [run for run in runs if not run.failed]
            frames, seconds = sum(r.frames for r in good if r.seconds), sum(r.seconds for r in good)
            overlaps = [run.overlap for run in good if np.isfinite(run.overlap)]
            table.add_row(
                label,
                f"{len(good)} of {self._total[label]}",
                str(sum(run.lost for run in good)),
                f"{np.mean(overlaps):.3f}" if overlaps else "",
                f"{frames / seconds:.0f}" if seconds else "",
            )
        return table
