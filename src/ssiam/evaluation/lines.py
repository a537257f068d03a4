"""Lines of numbers in text files: read with care, written whole or not at all."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from stat import S_ISREG

from ssiam.errors import SsiamError
from ssiam.outputs import atomic_write, make_folder

# What is read of a file: a polygon of every frame of ten hours fits, a disk image does not.
_MAX_BYTES = 64 * 2**20


class ResultsError(SsiamError):
    """Results that are missing, or damaged; the message names file and line."""


def read_lines(path: Path) -> Iterator[tuple[int, list[float]]]:
    """Line number, from 1, and numbers of every line; empty lines at the end are ignored.

    Numbers stand between commas, blanks or tabs; "nan" is one, infinity is none.

    Raises
    ------
    ResultsError
        The file cannot be read, is too large, or holds a line that is not of numbers.
    """
    lines = _text(path).rstrip().splitlines()
    for number, line in enumerate(lines, 1):
        yield number, _numbers(path, number, line)


def line_error(path: Path, number: int, reason: str) -> ResultsError:
    """The `ResultsError` of a line, counted from 1."""
    return ResultsError(f"{path}, line {number}: {reason}")


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Write lines so that `path` holds all of them or what it held before; makes its folder.

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
            raise ResultsError(f"{path}: is no file; results are text files")
        if found.st_size > _MAX_BYTES:
            raise ResultsError(
                f"{path}: has {found.st_size} bytes, more than the {_MAX_BYTES} of any results"
            )
        return path.read_bytes().decode("ascii")
    except UnicodeDecodeError:
        raise ResultsError(f"{path}: is no text; results are lines of numbers") from None
    except OSError as error:
        raise ResultsError(f"{path}: cannot be read ({error.strerror or error})") from error


def _numbers(path: Path, number: int, line: str) -> list[float]:
    parts = line.replace(",", " ").split()
    try:
        values = [float(part) for part in parts]
    except ValueError:
        raise line_error(path, number, f"{_shown(line)} is not a line of numbers") from None
    if not values or any(math.isinf(value) for value in values):
        raise line_error(path, number, f"{_shown(line)} is not a line of finite numbers")
    return values


def _shown(line: str) -> str:
    """A line, short_repr, on one line whatever it holds."""
    return repr(line if len(line) <= 40 else f"{line[:40]}...")
