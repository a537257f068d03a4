"""What `ssiam bench` tells: a live table while it runs, and the same one at the end."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.table import Table

from ssiam.datasets import Shake
from ssiam.errors import IncompleteError
from ssiam.evaluation.runs.bench import Task, TaskResult

_FILE_WIDTH = 120  # characters of the table where it does not go to a terminal

# Tracker's label and strength of the shake.
_Row: TypeAlias = tuple[str, float]


class Scoreboard:
    """One row for each tracker and strength of shake, on standard error while the runs go on."""

    def __init__(self, todo: Sequence[Task]) -> None:
        self._total = Counter(_row(task.entry.label, task.shake) for task in todo)
        self._done: dict[_Row, list[TaskResult]] = {row: [] for row in self._total}
        self._shaken = any(task.shake is not None for task in todo)
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

    def add(self, done: TaskResult) -> None:
        """A run has ended."""
        self._done[_row(done.label, done.shake)].append(done)
        if self._shown:
            self._live.update(self._table(), refresh=True)

    def show(self, out: Path) -> None:
        """Print the table, and the runs without a result with their reasons.

        Raises
        ------
        IncompleteError
            There are such runs; the message tells of the first one.
        """
        width = None if sys.stdout.isatty() else _FILE_WIDTH
        Console(width=width).print(self._table())
        failed = [done for runs in self._done.values() for done in runs if done.failed]
        for done in failed:
            print(f"no result: {_described(done)}")
        print(f"results: {out}")
        if failed:
            raise IncompleteError(
                f"{len(failed)} of {sum(self._total.values())} runs have no result and will be "
                f"tried again when the command is; the first: {_described(failed[0])}"
            )

    def _table(self) -> Table:
        return self._shaken_table() if self._shaken else self._plain_table()

    def _plain_table(self) -> Table:
        table = Table("tracker", "sequences", "lost", "overlap", "frames a second")
        for (label, strength), runs in self._done.items():
            found = _Sums(runs)
            table.add_row(
                label,
                f"{found.runs} of {self._total[label, strength]}",
                str(found.lost),
                found.overlap,
                f"{1 / found.seconds:.0f}" if found.seconds else "",
            )
        return table

    def _shaken_table(self) -> Table:
        headings = ("shake", "runs", "frames", "lost", "overlap", "ms a frame")
        table = Table("tracker", *headings)
        for (label, strength), runs in self._done.items():
            found = _Sums(runs)
            table.add_row(
                label,
                f"{100 * strength:g} %",
                f"{found.runs} of {self._total[label, strength]}",
                str(found.frames),
                str(found.lost),
                found.overlap,
                f"{1000 * found.seconds:.1f}" if found.seconds else "",
            )
        return table


class _Sums:
    """What a row tells of its runs; those that failed are left out."""

    def __init__(self, done: Sequence[TaskResult]) -> None:
        good = [run for run in done if not run.failed]
        timed = [run for run in good if run.seconds]
        overlaps = [run.overlap for run in good if np.isfinite(run.overlap)]
        tracked = sum(run.frames for run in timed)
        self.runs = len(good)
        self.frames = sum(run.frames for run in good)
        self.lost = sum(run.lost for run in good)
        self.overlap = f"{np.mean(overlaps):.3f}" if overlaps else ""
        # Seconds a frame; 0 if none was timed.
        self.seconds = sum(run.seconds for run in timed) / tracked if tracked else 0.0


def _described(done: TaskResult) -> str:
    """A run that failed, and why."""
    shake = f", shake {done.shake.label}" if done.shake is not None else ""
    return f"{done.label} on {done.sequence}{shake}: {done.failed}"


def _row(label: str, shake: Shake | None) -> _Row:
    return label, shake.strength if shake else 0.0
