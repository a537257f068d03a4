"""`parse_boxes`: the targets that ``--box`` gives, as words or in a CSV file."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from ssiam.cli.moments import Moment, PlannedTarget, parse_moment
from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.outputs import NamedPath

BOX_COLUMNS: Final = ("x", "y", "w", "h")
"""Columns of a file of boxes that must be there: pixels, (x, y) the top left corner."""

MOMENT_COLUMNS: Final = ("frame", "time")
"""Columns that may be there: when the target begins, at most one of them in a row."""

_FILE_MARK = "@"
_LARGEST_FILE = 1 << 20  # bytes
_MOST_TARGETS = 1000
_LONGEST_VALUE = 40  # characters of a bad value that a message quotes


def parse_boxes(texts: Sequence[str]) -> list[PlannedTarget]:
    """The targets of all ``--box`` options, in their order.

    Parameters
    ----------
    texts : sequence of str
        ``x,y,w,h``, ``MOMENT:x,y,w,h`` with a frame number or a time, or ``@FILE`` with a CSV
        file of boxes.

    Raises
    ------
    ArgumentError
        A text has none of these forms, or a file cannot be read or has a bad line, whose number
        is in the message.
    """
    found: list[PlannedTarget] = []
    for text in texts:
        if text.startswith(_FILE_MARK):
            found += _read_boxes(Path(text.removeprefix(_FILE_MARK)))
        else:
            found.append(_parse_box(text))
    return found


def box_files(texts: Sequence[str]) -> list[NamedPath]:
    """The files that ``--box`` reads, to check that no output is one of them."""
    return [
        ("--box", Path(text.removeprefix(_FILE_MARK)))
        for text in texts
        if text.startswith(_FILE_MARK)
    ]


def _parse_box(text: str) -> PlannedTarget:
    prefix, colon, numbers = text.rpartition(":")
    begins = parse_moment(prefix) if colon else None
    if colon and begins is None:
        raise ArgumentError(
            f"--box {text!r}: {prefix!r} is not a frame or a time: give a frame number or a time "
            "before the box, such as 300:120,80,40,60 or 12s:120,80,40,60 or 0:12:120,80,40,60"
        )
    try:
        x, y, w, h = (float(number) for number in numbers.split(","))
    except ValueError:
        raise ArgumentError(
            f"--box {text!r} is not a box: give x,y,width,height in pixels, such as 120,80,40,60; "
            "--pick shows what is in the frame"
        ) from None
    return PlannedTarget((x, y, w, h), begins, f"--box {text}")


def _read_boxes(path: Path) -> list[PlannedTarget]:
    """The targets of a CSV file, one a line; with a header, or x,y,w,h without one."""
    columns: Sequence[str] = BOX_COLUMNS
    found: list[PlannedTarget] = []
    for number, cells in _lines(path):
        if not found and number == 1 and not _is_number(cells[0]):
            columns = _header(path, cells)
            continue
        try:
            found.append(_target(dict(_named(columns, cells)), f"{path}, line {number}"))
        except ValueError as error:
            raise ArgumentError(f"--box {_FILE_MARK}{path}: line {number}: {error}") from None
        if len(found) > _MOST_TARGETS:
            raise ArgumentError(
                f"--box {_FILE_MARK}{path}: line {number}: over {_MOST_TARGETS} targets; each line "
                "is one target, not one frame of a target"
            )
    if not found:
        raise ArgumentError(f"--box {_FILE_MARK}{path}: has no box; give lines of x,y,w,h")
    return found


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line that is not empty."""
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise ArgumentError(
            f"--box {_FILE_MARK}{path}: cannot be read ({error.strerror}); give a CSV file with "
            "the columns x,y,w,h"
        ) from None
    if len(data) > _LARGEST_FILE:
        raise ArgumentError(
            f"--box {_FILE_MARK}{path}: is larger than 1 MiB; is it a list of boxes?"
        )
    text = data.decode("utf-8-sig", errors="replace")
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if any(stripped):
                yield reader.line_num, stripped
    except csv.Error as error:
        raise ArgumentError(
            f"--box {_FILE_MARK}{path}: line {reader.line_num}: is not CSV ({error})"
        ) from None


def _header(path: Path, cells: Sequence[str]) -> list[str]:
    columns = [cell.lower() for cell in cells]
    missing = [name for name in BOX_COLUMNS if name not in columns]
    if missing:
        raise ArgumentError(
            f"--box {_FILE_MARK}{path}: line 1: {','.join(cells)[:_LONGEST_VALUE]!r} has no column "
            f"{missing[0]}: the columns are x,y,w,h and, if a target begins later, frame or time"
        )
    return columns


def _named(columns: Sequence[str], cells: Sequence[str]) -> Iterator[tuple[str, str]]:
    if len(cells) != len(columns):
        raise ValueError(f"has {len(cells)} values, not the {len(columns)} of {','.join(columns)}")
    return zip(columns, cells, strict=True)


def _target(values: dict[str, str], label: str) -> PlannedTarget:
    """The target of a line; `ValueError` with the reason if it is invalid."""
    x, y, w, h = (_number(name, values[name]) for name in BOX_COLUMNS)
    box: XYWH = (x, y, w, h)
    given = [name for name in MOMENT_COLUMNS if values.get(name)]
    if len(given) > 1:
        raise ValueError("has both a frame and a time: give one of them")
    begins = _moment(given[0], values[given[0]]) if given else None
    return PlannedTarget(box, begins, label)


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{name} is {text[:_LONGEST_VALUE]!r}, not a number of pixels") from None
    if not math.isfinite(value):
        raise ValueError(f"{name} is {text[:_LONGEST_VALUE]!r}: give pixels")
    return value


def _moment(name: str, text: str) -> Moment:
    """The moment of a cell; a plain number is a frame or seconds, depending on the column."""
    moment = parse_moment(f"{text}s" if name == "time" and _is_number(text) else text)
    if moment is None or (name == "frame" and moment.frame is None):
        example = (
            "a frame number, such as 300" if name == "frame" else "a time, such as 12.5 or 0:12"
        )
        raise ValueError(f"{name} is {text[:_LONGEST_VALUE]!r}: give {example}")
    return moment


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
