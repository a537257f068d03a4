"""Result files of VOT, OTB, LaSOT and GOT-10k: paths, reading and writing.

All files of `ssiam bench` are written by this module, completely or not at all.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from stat import S_ISREG
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import VideoSequence
from ssiam.errors import ArgumentError, SsiamError, similar_names
from ssiam.evaluation.measures.trajectory import Status, TrackedSequence, Trajectory
from ssiam.outputs import atomic_write, make_folder

Experiment: TypeAlias = Literal["baseline", "realtime", "unsupervised"]
# Decimals of pixels, as pysot, OTB and GOT-10k write them, and of seconds.
_VOT_DECIMALS, _BOX_DECIMALS, _SECOND_DECIMALS = 4, 3, 8
_CODES = (Status.SKIPPED, Status.INITIALIZED, Status.FAILED)
# Size limit of files that are read: ten hours of polygons at 25 frames per second.
_MAX_BYTES = 64 * 2**20


class ResultsError(SsiamError):
    """Results are missing or damaged; the message names file and line."""


def vot_path(
    results: Path, sequence: str, repetition: int = 1, experiment: Experiment = "baseline"
) -> Path:
    """``RESULTS/baseline/<sequence>/<sequence>_001.txt``; repetitions count from 1.

    Raises
    ------
    ArgumentError
        The name of the sequence is not a valid file name.
    """
    folder = results / experiment / file_name(sequence)
    return folder / f"{sequence}_{repetition:03d}.txt"


def otb_path(results: Path, sequence: str) -> Path:
    """``RESULTS/<sequence>.txt``, the layout of OTB and LaSOT."""
    return results / f"{file_name(sequence)}.txt"


def got10k_path(results: Path, sequence: str, repetition: int = 1) -> Path:
    """``RESULTS/<sequence>/<sequence>_001.txt``; repetitions count from 1."""
    return results / file_name(sequence) / f"{sequence}_{repetition:03d}.txt"


def repetitions(first: Path) -> list[Path]:
    """The files ``..._001.txt``, ``..._002.txt`` and so on, given the path of the first one."""
    stem = first.stem[: -len("001")]
    pattern = re.compile(re.escape(stem) + r"\d{3}\.txt")
    try:
        return sorted(path for path in first.parent.iterdir() if pattern.fullmatch(path.name))
    except (FileNotFoundError, NotADirectoryError):
        return []


def read_vot(path: Path) -> Trajectory:
    """Read a run of VOT: lines ``1`` for start, ``2`` for lost, ``0`` for skipped, or a region.

    A region has 4 or 8 numbers, 0-based pixels. One that contains nan counts as skipped, as in
    vot-toolkit.

    Raises
    ------
    ResultsError
        The file cannot be read, or has another kind of line.
    """
    statuses: list[int] = []
    rows: list[list[float]] = []
    for number, values in read_lines(path):
        status = _status(values)
        if status is None:
            raise line_error(
                path,
                number,
                f"not a region: expected 0, 1, 2, x,y,w,h or four x,y, got {len(values)} numbers",
            )
        statuses.append(status)
        rows.append((values if status == Status.TRACKED else []) + [math.nan] * 8)
    regions = np.array([row[:8] for row in rows], dtype=np.float64).reshape(-1, 8)
    if np.isnan(regions[:, 4:]).all():
        regions = regions[:, :4].copy()
    return Trajectory(np.array(statuses, dtype=np.int8), regions)


def write_vot(path: Path, trajectory: Trajectory) -> None:
    """Write a run in the format of `read_vot`; `SinkError` if the file cannot be written."""
    write_lines(
        path,
        (
            _formatted(row[~np.isnan(row)], _VOT_DECIMALS)
            if status == Status.TRACKED
            else str(int(status))
            for status, row in zip(trajectory.status, trajectory.regions, strict=True)
        ),
    )


def read_boxes(path: Path, *, origin: int = 1) -> Trajectory:
    """Read a one-pass run: a line ``x,y,w,h`` per frame, separated by commas, tabs or spaces.

    Parameters
    ----------
    path : Path
    origin : int
        Coordinate of the first pixel: 1 in OTB and LaSOT, 0 in GOT-10k.

    Raises
    ------
    ResultsError
        The file cannot be read, or a line does not have four numbers.
    """
    rows = []
    for number, values in read_lines(path):
        if len(values) != 4:
            raise line_error(
                path, number, f"not a box: expected x,y,w,h, got {len(values)} numbers"
            )
        rows.append(values)
    boxes = np.array(rows, dtype=np.float64).reshape(-1, 4)
    return Trajectory.from_regions(boxes - np.array([origin, origin, 0, 0]))


def write_boxes(path: Path, trajectory: Trajectory, *, origin: int = 1) -> None:
    """Write a run in the format of `read_boxes`; ``0,0,0,0`` where there is no box.

    Raises
    ------
    ArgumentError
        The trajectory contains polygons, which these formats do not have.
    SinkError
        The file cannot be written.
    """
    if trajectory.regions.shape[1] != 4:
        raise ArgumentError(f"{path}: one-pass results are boxes, not polygons")
    boxes = trajectory.regions + np.array([origin, origin, 0, 0])
    boxes[trajectory.status != Status.TRACKED] = 0
    write_lines(path, (_formatted(box, _BOX_DECIMALS) for box in boxes))


def read_got10k(results: Path, sequence: str) -> list[Trajectory]:
    """Read all repetitions of a sequence, with times if ``<sequence>_time.txt`` exists."""
    paths = repetitions(got10k_path(results, sequence))
    runs = [read_boxes(path, origin=0) for path in paths]
    times = results / sequence / f"{sequence}_time.txt"
    if not times.exists():
        return runs
    return [_timed(run, times, column) for column, run in enumerate(runs)]


def write_got10k(results: Path, sequence: str, runs: Sequence[Trajectory]) -> None:
    """Write every repetition, and their seconds as columns of one file (0 if not measured)."""
    for repetition, run in enumerate(runs, 1):
        write_boxes(got10k_path(results, sequence, repetition), run, origin=0)
    seconds = [np.zeros(len(run)) if run.seconds is None else run.seconds for run in runs]
    path = results / sequence / f"{sequence}_time.txt"
    write_lines(path, (_formatted(row, _SECOND_DECIMALS) for row in np.stack(seconds, axis=1)))


def file_name(sequence: str) -> str:
    """The name of a sequence, checked: datasets are untrusted, and it becomes a file name."""
    if not sequence or sequence in (".", "..") or set(sequence) & set("/\\\0"):
        raise ArgumentError(
            f"not a sequence name: {sequence!r}; its file would be outside of the results folder"
        )
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
            raise line_error(path, number, "expected one row per box and one column per repetition")
        seconds[number - 1] = values[column]
    return Trajectory(run.status, run.regions, seconds)


def _formatted(values: NDArray[np.float64], decimals: int) -> str:
    return ",".join(f"{value:.{decimals}f}" for value in values)


def read_lines(path: Path) -> Iterator[tuple[int, list[float]]]:
    """Line number from 1 and values of every line; empty lines at the end are ignored.

    Values are separated by commas, spaces or tabs. nan is allowed, infinity is not.

    Raises
    ------
    ResultsError
        The file cannot be read or is too large, or a line is not a list of numbers.
    """
    lines = _text(path).rstrip().splitlines()
    for number, line in enumerate(lines, 1):
        yield number, _numbers(path, number, line)


def line_error(path: Path, number: int, reason: str) -> ResultsError:
    """The `ResultsError` for a line, counted from 1."""
    return ResultsError(f"{path}, line {number}: {reason}")


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Replace the file `path` by these lines, or leave it as it was; creates its folder.

    Raises
    ------
    SinkError
        The file cannot be written.
    """
    data = "".join(f"{line}\n" for line in lines).encode("ascii")
    make_folder(path.parent)
    with atomic_write(path, "wb", hidden=True) as file:
        file.write(data)


def _text(path: Path) -> str:
    try:
        found = path.stat()
        if not S_ISREG(found.st_mode):
            raise ResultsError(f"{path}: is not a regular file; results are text files")
        if found.st_size > _MAX_BYTES:
            raise ResultsError(
                f"{path}: has {found.st_size} bytes; results have at most {_MAX_BYTES}"
            )
        return path.read_bytes().decode("ascii")
    except UnicodeDecodeError:
        raise ResultsError(f"{path}: is not text; results are lines of numbers") from None
    except OSError as error:
        raise ResultsError(f"{path}: cannot be read ({error.strerror or error})") from error


def _numbers(path: Path, number: int, line: str) -> list[float]:
    parts = line.replace(",", " ").split()
    try:
        values = [float(part) for part in parts]
    except ValueError:
        raise line_error(path, number, f"{_shortened(line)} is not a line of numbers") from None
    if not values or any(math.isinf(value) for value in values):
        raise line_error(path, number, f"{_shortened(line)} is not a line of finite numbers")
    return values


def _shortened(line: str) -> str:
    """At most 40 characters of a line, quoted, with control characters escaped."""
    return repr(line if len(line) <= 40 else f"{line[:40]}...")


@dataclass(frozen=True, eq=False)
class TrackerResults:
    """Results of one tracker on a dataset.

    Attributes
    ----------
    name : str
        Name of the folder.
    tracked : tuple of TrackedSequence
    notes : tuple of str
        Lines for the user: what was missing or too short, and how it was handled.
    """

    name: str
    tracked: tuple[TrackedSequence, ...]
    notes: tuple[str, ...]


def read_results(
    folder: Path, sequences: Iterable[VideoSequence], experiment: Experiment = "baseline"
) -> TrackerResults:
    """Read a tracker's runs from ``folder/baseline/<sequence>/<sequence>_001.txt``.

    Sequences without results are left out. A run that is shorter or longer than its sequence is
    measured over the frames that both have.

    Parameters
    ----------
    folder : Path
    sequences : iterable of VideoSequence
    experiment : {"baseline", "realtime", "unsupervised"}
        Subfolder that is read in place of ``baseline``.

    Raises
    ------
    ResultsError
        A file is damaged, or the folder has no results of any of the sequences.
    """
    tracked, notes = [], []
    for sequence in sequences:
        paths = repetitions(vot_path(folder, sequence.name, experiment=experiment))
        if not paths:
            notes.append(_left_out(folder, sequence.name, experiment))
            continue
        runs = [_fitted(path, len(sequence.truth), notes) for path in paths]
        tracked.append(TrackedSequence(sequence, tuple(runs)))
    if not tracked:
        example = vot_path(Path(), "<sequence>", experiment=experiment)
        raise ResultsError(f"{folder}: no results of the dataset; expected {example}")
    return TrackerResults(folder.name or folder.resolve().name, tuple(tracked), tuple(notes))


def _left_out(folder: Path, name: str, experiment: Experiment) -> str:
    """Why a sequence is left out, with the folder that was probably meant for it."""
    others = sorted(path.name for path in (folder / experiment).glob("*") if path.name != name)
    same = similar_names(name, others)
    hint = f" (is {' or '.join(same)} meant? rename it and the files in it)" if same else ""
    return f"{folder}: no results for sequence {name}; it is left out{hint}"


def _fitted(path: Path, length: int, notes: list[str]) -> Trajectory:
    run = read_vot(path)
    if len(run) == 0:
        raise ResultsError(f"{path}: is empty; delete it to leave the sequence out")
    if len(run.failures) > len(run.initializations):
        raise ResultsError(f"{path}: has more failures (2) than starts (1); is it truncated?")
    if len(run) != length:
        measured = min(len(run), length)
        notes.append(
            f"{path}: {len(run)} lines for {length} frames; the first {measured} are measured"
        )
    return run.first(length)
