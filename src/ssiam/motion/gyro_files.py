"""Readers of gyro logs: Gyroflow's .gcsv and the CSV of Betaflight's blackbox."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from ssiam.errors import SourceError
from ssiam.motion.gyro import GyroTrack

_LARGEST_FILE: Final = 512 << 20  # bytes; an hour at 1 kHz has 300 MB
_GYROFLOW: Final = ("GYROFLOW IMU LOG", "CAMERA IMU LOG")  # first lines
_GYROFLOW_COLUMNS: Final = ("t", "gx", "gy", "gz")
_BETAFLIGHT_COLUMNS: Final = ("time", "gyroADC[0]", "gyroADC[1]", "gyroADC[2]")
_MICROSECOND: Final = 1e-6
_LARGEST: Final = 1e15  # of a number in a log


def read_gyro(path: str | Path) -> GyroTrack:
    """Read the angular rates of a log.

    Parameters
    ----------
    path : str or Path
        Gyroflow's .gcsv (https://docs.gyroflow.xyz/app/technical-details/gcsv-format), whose
        orientation is applied, or the CSV that blackbox_decode or Betaflight's Blackbox Explorer
        writes (columns "time", microseconds, and "gyroADC[0]" to "gyroADC[2]", degrees per second
        unless they say rad/s: roll, pitch and yaw, which become z, x and y).

    Returns
    -------
    GyroTrack
        On the clock of the log. Axes and signs still differ from the camera's by how the sensor is
        mounted: see `synchronize`. Rows whose time does not increase are left out.

    Raises
    ------
    SourceError
        The file cannot be read, is not such a log, or has a value that is not a number.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise SourceError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError:
        raise SourceError(f"{path!r}: is not a path") from None
    if len(content) > _LARGEST_FILE:
        raise SourceError(f"{path}: is larger than {_LARGEST_FILE >> 20} MiB; split it")
    lines = content.decode("utf-8-sig", errors="replace").splitlines()
    if lines and lines[0].strip().upper() in _GYROFLOW:
        return _gyroflow(path, lines)
    return _betaflight(path, lines)


def _gyroflow(path: Path, lines: Sequence[str]) -> GyroTrack:
    """The track of a .gcsv file."""
    header: dict[str, str] = {}
    cells: list[str] = []
    first = 0  # line after that of the columns
    while cells[:1] != ["t"]:
        if first == len(lines):
            raise SourceError(f"{path}: has no line t,gx,gy,gz")
        cells, first = _cells(lines[first]), first + 1
        header[cells[0].lower()] = cells[1] if len(cells) > 1 else ""
    columns = _columns(path, cells, _GYROFLOW_COLUMNS)
    scales = [
        _number(path, name, header.get(name, default))
        for name, default in (("tscale", "0.001"), ("gscale", ""))
    ]
    if min(scales) <= 0:
        raise SourceError(f"{path}: tscale or gscale is not above 0")
    values = _values(path, lines, first, columns) * (scales[0], *3 * [scales[1]])
    track = _track(path, values)
    orientation = header.get("orientation", "").strip() or "XYZ"
    if sorted(orientation.upper()) != ["X", "Y", "Z"]:
        raise SourceError(
            f"{path}: orientation is {orientation[:20]!r}, not X, Y and Z in an order"
        )
    return track.oriented(orientation)


def _betaflight(path: Path, lines: Sequence[str]) -> GyroTrack:
    """The track of a blackbox CSV; settings may stand before the line of columns."""
    for number, line in enumerate(lines):
        if "gyroADC[0]" not in line:
            continue
        heads = [cell.partition("(") for cell in _cells(line)]  # name (unit)
        columns = _columns(path, [name.rstrip() for name, _, _ in heads], _BETAFLIGHT_COLUMNS)
        unit = heads[columns[1]][2]
        scale = 1.0 if unit == "rad/s)" else math.pi / 180
        values = _values(path, lines, number + 1, columns) * (_MICROSECOND, *3 * [scale])
        roll_pitch_yaw = _track(path, values)
        return roll_pitch_yaw.oriented("YZX")
    raise SourceError(
        f"{path}: is neither Gyroflow's .gcsv nor a blackbox CSV with columns time and gyroADC[0]"
    )


def _cells(line: str) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.split(",")]


def _columns(path: Path, names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Index of each wanted column."""
    missing = [name for name in wanted if name not in names]
    if missing:
        raise SourceError(f"{path}: has no column {missing[0]}")
    return [names.index(name) for name in wanted]


def _values(
    path: Path, lines: Sequence[str], first: int, columns: Sequence[int]
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Numbers (N, 4) of the columns in the lines from `first` on; empty lines are left out."""
    return np.array(list(_rows(path, lines, first, columns)), np.float64).reshape(-1, 4)


def _rows(
    path: Path, lines: Sequence[str], first: int, columns: Sequence[int]
) -> Iterator[list[float]]:
    for number in range(first, len(lines)):
        cells = _cells(lines[number])
        if cells == [""]:
            continue
        if len(cells) <= max(columns):
            raise SourceError(f"{path}: line {number + 1} has {len(cells)} values")
        yield [_number(path, f"line {number + 1}", cells[column]) for column in columns]


def _number(path: Path, name: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= _LARGEST:
        raise SourceError(f"{path}: {name}: {word[:40]!r} is not a number")
    return value


def _track(path: Path, values: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> GyroTrack:
    """The track of rows time, x, y, z."""
    times = values[:, 0]
    latest = np.maximum.accumulate(np.concatenate([[-np.inf], times[:-1]]))
    increasing = times > latest[: len(times)]
    values = values[increasing]
    if len(values) < 2:
        raise SourceError(f"{path}: has rates for {len(values)} times, at least two are needed")
    return GyroTrack(values[:, 0], values[:, 1:])
