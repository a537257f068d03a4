"""Where the result files of VOT, OTB, LaSOT and GOT-10k lie, and what their lines say."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.evaluation.lines import line_error, read_lines, write_lines
from ssiam.evaluation.trajectory import Status, Trajectory

Experiment: TypeAlias = Literal["baseline", "realtime", "unsupervised"]

# Decimals of pixels: as pysot, OTB and GOT-10k write them; and of seconds.
_VOT_DECIMALS, _BOX_DECIMALS, _SECOND_DECIMALS = 4, 3, 8
_CODES = (Status.SKIPPED, Status.INITIALIZED, Status.FAILED)


def vot_path(
    results: Path, sequence: str, repetition: int = 1, experiment: Experiment = "baseline"
) -> Path:
    """``RESULTS/baseline/<sequence>/<sequence>_001.txt``; repetitions count from 1.

    Raises
    ------
    ArgumentError
        The name of the sequence is no name of a file.
    """
    folder = results / experiment / file_name(sequence)
    return folder / f"{sequence}_{repetition:03d}.txt"


def otb_path(results: Path, sequence: str) -> Path:
    """``RESULTS/<sequence>.txt``, where OTB and LaSOT keep it."""
    return results / f"{file_name(sequence)}.txt"


def got10k_path(results: Path, sequence: str, repetition: int = 1) -> Path:
    """``RESULTS/<sequence>/<sequence>_001.txt``; repetitions count from 1."""
    return results / file_name(sequence) / f"{sequence}_{repetition:03d}.txt"


def repetitions(first: Path) -> list[Path]:
    """The files ``..._001.txt``, ``..._002.txt`` and so on that lie beside the first one."""
    stem = first.stem[: -len("001")]
    pattern = re.compile(re.escape(stem) + r"\d{3}\.txt")
    try:
        return sorted(path for path in first.parent.iterdir() if pattern.fullmatch(path.name))
    except (FileNotFoundError, NotADirectoryError):
        return []


def read_vot(path: Path) -> Trajectory:
    """A run of VOT: lines ``1`` started, ``2`` lost, ``0`` skipped, else 4 or 8 numbers.

    A region that holds nan counts as skipped, as in vot-toolkit. 0-based pixels.

    Raises
    ------
    ResultsError
        The file cannot be read, or has a line of something else.
    """
    statuses: list[int] = []
    rows: list[list[float]] = []
    for number, values in read_lines(path):
        status = _status(values)
        if status is None:
            raise line_error(
                path, number, f"{len(values)} numbers are no region: give 0, 1, 2, x,y,w,h or 4 x,y"
            )
        statuses.append(status)
        rows.append((values if status == Status.TRACKED else []) + [math.nan] * 8)
    regions = np.array([row[:8] for row in rows], dtype=np.float64).reshape(-1, 8)
    if np.isnan(regions[:, 4:]).all():
        regions = regions[:, :4].copy()
    return Trajectory(np.array(statuses, dtype=np.int8), regions)


def write_vot(path: Path, trajectory: Trajectory) -> None:
    """Write what `read_vot` reads; `SinkError` if that is not possible."""
    write_lines(
        path,
        (
            _joined(row[~np.isnan(row)], _VOT_DECIMALS)
            if status == Status.TRACKED
            else str(int(status))
            for status, row in zip(trajectory.status, trajectory.regions, strict=True)
        ),
    )


def read_boxes(path: Path, *, origin: int = 1) -> Trajectory:
    """A one-pass run: a line ``x,y,w,h`` for each frame, between commas, tabs or blanks.

    Parameters
    ----------
    path : Path
    origin : int
        What the format calls the first pixel: 1 in OTB and LaSOT, 0 in GOT-10k.

    Raises
    ------
    ResultsError
        The file cannot be read, or has a line that is not of four numbers.
    """
    rows = []
    for number, values in read_lines(path):
        if len(values) != 4:
            raise line_error(path, number, f"{len(values)} numbers are no box: give x,y,w,h")
        rows.append(values)
    boxes = np.array(rows, dtype=np.float64).reshape(-1, 4)
    return Trajectory.of_boxes(boxes - np.array([origin, origin, 0, 0]))


def write_boxes(path: Path, trajectory: Trajectory, *, origin: int = 1) -> None:
    """Write what `read_boxes` reads; ``0,0,0,0`` where there is no box.

    Raises
    ------
    ArgumentError
        The trajectory holds polygons; none of these formats has them.
    SinkError
        The file cannot be written.
    """
    if trajectory.regions.shape[1] != 4:
        raise ArgumentError(f"{path}: one-pass results are boxes, not polygons")
    boxes = trajectory.regions + np.array([origin, origin, 0, 0])
    boxes[trajectory.status != Status.TRACKED] = 0
    write_lines(path, (_joined(box, _BOX_DECIMALS) for box in boxes))


def read_got10k(results: Path, sequence: str) -> list[Trajectory]:
    """All repetitions of a sequence, with their times if ``<sequence>_time.txt`` is there."""
    paths = repetitions(got10k_path(results, sequence))
    runs = [read_boxes(path, origin=0) for path in paths]
    times = results / sequence / f"{sequence}_time.txt"
    if not times.exists():
        return runs
    return [_timed(run, times, column) for column, run in enumerate(runs)]


def write_got10k(results: Path, sequence: str, runs: Sequence[Trajectory]) -> None:
    """Write every repetition, and their seconds (0 where not measured) as columns of one file."""
    for repetition, run in enumerate(runs, 1):
        write_boxes(got10k_path(results, sequence, repetition), run, origin=0)
    seconds = [np.zeros(len(run)) if run.seconds is None else run.seconds for run in runs]
    path = results / sequence / f"{sequence}_time.txt"
    write_lines(path, (_joined(row, _SECOND_DECIMALS) for row in np.stack(seconds, axis=1)))


def file_name(sequence: str) -> str:
    """The name of a sequence, if it can be one of a file: datasets are not to be trusted."""
    if not sequence or sequence in (".", "..") or set(sequence) & set("/\\\0"):
        raise ArgumentError(f"{sequence!r} is no name of a sequence: it would leave its folder")
    return sequence


def _status(values: list[float]) -> Status | None:
    if len(values) == 1:
        return Status(int(values[0])) if values[0] in _CODES else None
    if len(values) not in (4, 8):
        return None
    return Status.SKIPPED if any(math.isnan(value) for value in values) else Status.TRACKED


def _timed(run: Trajectory, path: Path, column: int) -> Trajectory:
    seconds = np.full(len(run), np.nan)
    for number, values in read_lines(path):
        if number > len(run) or column >= len(values):
            raise line_error(path, number, "there are fewer boxes or more repetitions than times")
        seconds[number - 1] = values[column]
    return Trajectory(run.status, run.regions, seconds)


def _joined(values: NDArray[np.float64], decimals: int) -> str:
    return ",".join(f"{value:.{decimals}f}" for value in values)
