"""`Summary`: the statistics of a tracking run, printed at its end."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, TextIO

import numpy as np

from ssiam.errors import IncompleteError, one_line
from ssiam.geometry import Transform, frame_center, rigid_parameters
from ssiam.track import Track

_log = logging.getLogger(__name__)

_SMOOTHING: Final = 0.9  # weight of the past in the running mean of the time per frame


class Timer:
    """Measures the time spent in a `with` block: the tracking, without decoding and drawing."""

    def __init__(self) -> None:
        self.total = 0.0
        self._start = 0.0
        self._recent: float | None = None

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *exc: object) -> None:
        elapsed = time.perf_counter() - self._start
        self.total += elapsed
        recent = elapsed if self._recent is None else self._recent
        self._recent = _SMOOTHING * recent + (1 - _SMOOTHING) * elapsed

    @property
    def fps(self) -> float | None:
        """Recent frames per second; None before the first frame."""
        return 1 / self._recent if self._recent else None


class Summary:
    """Statistics of a run, printed at its end."""

    def __init__(self, source: str, tracker: str, stabilize: str, targets: int) -> None:
        self.timer = Timer()
        self._title = f"{source} with {tracker}, stabilize={stabilize}"
        self._frames = 0
        self._steps = 0  # frames in which the tracker ran
        self._reliable = 0
        self._lost = np.zeros(targets, dtype=int)
        self._score = np.zeros(targets)
        self._tracked = np.zeros(targets, dtype=int)  # frames after each target's first
        self._begins: list[int | None] = [None] * targets  # each target's first frame
        self._main: int | None = None  # the target that began first, whose view is measured
        self._moved = np.zeros(2)  # px, summed: raw, stabilized
        self._prev_stab_from_raw: Transform | None = None
        self._failures: dict[str, list[str]] = {}  # target or camera -> frame and error of each

    @property
    def frames(self) -> int:
        """Number of frames so far."""
        return self._frames

    def add(self, frame_index: int, tracks: Sequence[Track | None]) -> None:
        """Count one written frame; the track of a target that has not begun is None."""
        self._frames += 1
        self._steps += self._main is not None
        for number, track in enumerate(tracks):
            if track is None:
                continue
            if self._begins[number] is None:
                self._begins[number] = frame_index
                continue
            self._lost[number] += track.lost
            self._score[number] += track.score
            self._tracked[number] += 1
        if self._main is None:
            begun = (number for number, track in enumerate(tracks) if track is not None)
            self._main = next(begun, None)
        main = None if self._main is None else tracks[self._main]
        if main is not None:
            self._add_view(main)

    def _add_view(self, track: Track) -> None:
        motion, stab_from_raw = track.motion, track.stab_from_raw
        if motion is None or stab_from_raw is None:
            return
        self._reliable += motion.reliable
        if self._prev_stab_from_raw is not None:
            stabilized = (
                stab_from_raw @ motion.cur_from_prev @ np.linalg.inv(self._prev_stab_from_raw)
            )
            center = frame_center(motion.size_wh)
            shifts = motion.shift_angle[:2], rigid_parameters(stabilized, center)[:2]
            self._moved += np.hypot(*np.transpose(shifts))
        self._prev_stab_from_raw = stab_from_raw

    def add_failures(self, frame_index: int, failures: Mapping[str, Exception]) -> None:
        """Record what failed in a frame, by name ("target 2", "camera")."""
        for name, error in failures.items():
            self._failures.setdefault(name, []).append(f"frame {frame_index}: {one_line(error)}")
            if len(self._failures[name]) == 1:
                _log.debug("%s, frame %d", name, frame_index, exc_info=error)

    def check_complete(self) -> None:
        """Raise `IncompleteError` if a target or the camera motion failed in some frame."""
        for name, errors in self._failures.items():
            raise IncompleteError(
                f"{name} could not be tracked in {len(errors)} of {self._frames} frames, which "
                f"count as lost; the first is {errors[0]}"
            )

    def print(
        self, file: TextIO, written: Sequence[tuple[str, Path]], notes: Sequence[str] = ()
    ) -> None:
        """Print the summary.

        Parameters
        ----------
        file : text file
        written : sequence of (str, Path)
            Kind and location of each output.
        notes : sequence of str
            Further lines.
        """
        for line in self._lines():
            print(line, file=file)
        for kind, path in written:
            print(f"  {kind}: {path}", file=file)
        for note in notes:
            print(f"  {note}", file=file)

    def _lines(self) -> Iterator[str]:
        steps = max(self._steps, 1)
        speed = self._steps / self.timer.total if self.timer.total else 0.0
        yield f"tracked {self._frames} frames of {self._title}: {speed:.0f} fps"
        for number, begins in enumerate(self._begins):
            yield f"  target {number + 1}: {self._target_text(number, begins)}"
        for name, errors in self._failures.items():
            yield f"  {name}: failed in {len(errors)} frames, the first is {errors[0]}"
        if self._prev_stab_from_raw is not None:
            raw, stabilized = self._moved / steps
            yield (
                f"  camera: motion known in {100 * self._reliable / steps:.0f} % of the frames, "
                f"{raw:.1f} px per frame; {stabilized:.1f} px in what the tracker sees"
            )

    def _target_text(self, number: int, begins: int | None) -> str:
        if begins is None:
            return "did not begin"
        score = self._score[number] / max(self._tracked[number], 1)
        text = f"lost in {self._lost[number]} frames, mean score {score:.2f}"
        is_late = self._tracked[number] < self._frames - 1
        return f"begins in frame {begins}, {text}" if is_late else text
