"""The lines of result files, .csv and .jsonl, read without trusting them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Final, TypeAlias

from ssiam.errors import AnnotationsError
from ssiam.video.layouts import COLUMNS

Record: TypeAlias = Mapping[str, float | None]

_NEEDED: Final = COLUMNS[: COLUMNS.index("y4") + 1]
_LONGEST_LINE: Final = 2048  # bytes; those that ssiam writes have less than 500
_MOST_LINES: Final = 1_000_000  # nine hours of one target at 30 frames a second
_LARGEST_NUMBER: Final = 1e12  # whose square is still a number that every format can hold
# Characters of a bad value that a message shows.
_SHOWN: Final = 40


def read_records(path: Path) -> Iterator[tuple[int, Record]]:
    """Line number and values by column of every line of what ``ssiam track --results`` wrote.

    Values are finite, or None for what is left out; truth values are 0 and 1.

    Raises
    ------
    AnnotationsError
        The file cannot be read, is of another kind, has too many or too long lines, or a line
        is damaged.
    """
    lines = _lines(path)
    parse = _parser(path, lines)
    for number, line in lines:
        if not line.strip():
            continue
        try:
            yield number, parse(line.decode("utf-8"))
        except (ValueError, OverflowError, RecursionError) as error:
            raise AnnotationsError(f"{path}: line {number}: {_reason(error)}") from None


def _parser(path: Path, lines: Iterator[tuple[int, bytes]]) -> Callable[[str], Record]:
    suffix = path.suffix.lower()
    if suffix == ".jsonl":
        return _json_record
    if suffix != ".csv":
        raise AnnotationsError(
            f"{path}: unknown kind of results; give a .csv or .jsonl of ssiam track --results"
        )
    _, header = next(lines, (1, b""))
    columns = header.decode("utf-8-sig", errors="replace").strip().split(",")
    missing = [name for name in _NEEDED if name not in columns]
    if missing:
        raise AnnotationsError(
            f"{path}: line 1 names no column {missing[0]!r}; is it a file of ssiam track --results?"
        )
    return partial(_csv_record, columns)


def _lines(path: Path) -> Iterator[tuple[int, bytes]]:
    try:
        with path.open("rb") as file:
            for number in count(1):
                line = file.readline(_LONGEST_LINE + 1)
                if not line:
                    return
                if len(line) > _LONGEST_LINE:
                    raise AnnotationsError(f"{path}: line {number} has over {_LONGEST_LINE} bytes")
                if number > _MOST_LINES:
                    raise AnnotationsError(f"{path}: line {number}: no more can be read; split it")
                yield number, line
    except OSError as error:
        raise AnnotationsError(f"{path}: cannot be read ({error.strerror})") from None


def _csv_record(columns: Sequence[str], line: str) -> Record:
    words = line.strip().split(",")
    if len(words) != len(columns):
        raise ValueError(f"has {len(words)} values where the header names {len(columns)}")
    values = dict(zip(columns, words, strict=True))
    return {name: _number(name, values[name].strip() or None) for name in _NEEDED}


def _json_record(line: str) -> Record:
    values = json.loads(line)
    if not isinstance(values, dict):
        raise ValueError("is not a JSON object")
    missing = [name for name in _NEEDED if name not in values]
    if missing:
        raise ValueError(f"has no {missing[0]!r}")
    wrong = [name for name in _NEEDED if isinstance(values[name], str | list | dict)]
    if wrong:
        raise ValueError(f"{wrong[0]} is {str(values[wrong[0]])[:_SHOWN]!r}, not a number")
    return {name: _number(name, values[name]) for name in _NEEDED}


def _number(name: str, value: Any) -> float | None:
    if value is None:
        return None
    try:
        number = float(value)
    except ValueError:
        raise ValueError(f"{name} is {value[:_SHOWN]!r}, not a number") from None
    if not math.isfinite(number) or abs(number) > _LARGEST_NUMBER:
        raise ValueError(f"{name} is {number}, which is out of range")
    return number


def _reason(error: Exception) -> str:
    if isinstance(error, json.JSONDecodeError):
        return f"is not JSON ({error.msg}); is it cut off?"
    if isinstance(error, UnicodeDecodeError):
        return "is not text"
    return str(error)
