"""What `ssiam track` tells: a progress bar while it runs, a few lines when it is done."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as RichProgress

from ssiam.errors import IncompleteError, one_line
from ssiam.geometry import Transform, frame_center, rigid_parameters
from ssiam.track import Track
from ssiam.trackers import TrackerGroup

_log = logging.getLogger(__name__)

_SMOOTHING = 0.9  # of the running mean of the time per frame


class Clock:
    """Measures the tracking alone: not the decoding, not the drawing."""

    def __init__(self) -> None:
        self.total = 0.0
        self._recent: float | None = None

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *exc: object) -> None:
        took = time.perf_counter() - self._start
        self.total += took
        recent = took if self._recent is None else self._recent
        self._recent = _SMOOTHING * recent + (1 - _SMOOTHING) * took

    @property
    def fps(self) -> float | None:
        """Frames a second of late; None before the first."""
        return 1 / self._recent if self._recent else None


class Progress:
    """A bar on standard error with speed and remaining time; nothing where that is no terminal."""

    def __init__(self, length: int | None) -> None:
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
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("tracking", total=length, completed=1, speed="")

    def __enter__(self) -> Progress:
        self._bar.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._bar.stop()

    def step(self, fps: float | None) -> None:
        """One frame is done."""
        self._bar.update(self._task, advance=1, speed="" if fps is None else f"{fps:.0f} fps")


class Report:
    """Counts while tracking, and sums up at the end."""

    def __init__(self, source: str, tracker: str, stabilize: str, targets: int) -> None:
        self.clock = Clock()
        self._title = f"{source} with {tracker}, stabilize={stabilize}"
        self._frames = 1
        self._reliable = 0
        self._lost = np.zeros(targets, dtype=int)
        self._score = np.zeros(targets)
        self._moved = np.zeros(2)  # px, summed: raw, steadied
        self._prev_stab_from_raw: Transform | None = None
        self._failures: dict[str, list[str]] = {}  # who failed -> frame and error, each time

    def add(self, tracks: Sequence[Track]) -> None:
        """Count one tracked frame."""
        self._frames += 1
        self._lost += [track.lost for track in tracks]
        self._score += [track.score for track in tracks]
        motion, stab_from_raw = tracks[0].motion, tracks[0].stab_from_raw
        if motion is None or stab_from_raw is None:
            return
        self._reliable += motion.reliable
        if self._prev_stab_from_raw is not None:
            steadied = (
                stab_from_raw @ motion.cur_from_prev @ np.linalg.inv(self._prev_stab_from_raw)
            )
            centre = frame_center(motion.size_wh)
            shifts = motion.shift_angle[:2], rigid_parameters(steadied, centre)[:2]
            self._moved += np.hypot(*np.transpose(shifts))
        self._prev_stab_from_raw = stab_from_raw

    def fail(self, frame_index: int, group: TrackerGroup) -> None:
        """Take note of what failed in a tracked frame."""
        failed: dict[str, Exception] = {
            f"target {place + 1}": error for place, error in group.failures.items()
        }
        if group.camera_failure is not None:
            failed["camera"] = group.camera_failure
        for who, error in failed.items():
            self._failures.setdefault(who, []).append(f"frame {frame_index}: {one_line(error)}")
            if len(self._failures[who]) == 1:
                _log.debug("%s, frame %d", who, frame_index, exc_info=error)

    def check_whole(self) -> None:
        """Raise `IncompleteError` if something failed on the way."""
        for who, errors in self._failures.items():
            raise IncompleteError(
                f"{who} could not be tracked in {len(errors)} of {self._frames} frames, where it "
                f"counts as lost; the first is {errors[0]}"
            )

    def show(self, written: Sequence[tuple[str, Path]], remarks: Sequence[str] = ()) -> None:
        """Print the summary.

        `written` is what was written, and where; a line for each of the `remarks` follows.
        """
        tracked = max(self._frames - 1, 1)
        speed = tracked / self.clock.total if self.clock.total else 0.0
        print(f"tracked {self._frames} frames of {self._title}: {speed:.0f} fps")
        for number, (lost, score) in enumerate(zip(self._lost, self._score, strict=True), 1):
            print(f"  target {number}: lost in {lost} frames, mean score {score / tracked:.2f}")
        for who, errors in self._failures.items():
            print(f"  {who}: an error in {len(errors)} frames, the first in {errors[0]}")
        if self._prev_stab_from_raw is not None:
            raw, steadied = self._moved / tracked
            print(
                f"  camera: known in {100 * self._reliable / tracked:.0f} % of the frames, "
                f"moves {raw:.1f} px a frame, {steadied:.1f} px in the steadied view"
            )
        for kind, path in written:
            print(f"  {kind}: {path}")
        for remark in remarks:
            print(f"  {remark}")
