"""Reading what annotation tools have written: the whole file, and single values of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

from ssiam.errors import AnnotationsError

_LARGEST_FILE: Final = 256 << 20  # bytes; an hour of masks has less
_LARGEST_NUMBER: Final = 1e9
_LONGEST_VALUE: Final = 40  # characters of a bad value that a message quotes
_LAST_FRAME: Final = 999_999


def read_file(path: Path) -> bytes:
    """The content of a file; `AnnotationsError` if it cannot be read or is too large."""
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise AnnotationsError(f"{path}: cannot be read ({error.strerror})") from None
    if len(content) > _LARGEST_FILE:
        raise AnnotationsError(f"{path}: is larger than {_LARGEST_FILE >> 20} MiB; split it")
    return content


def finite(file: str | Path, name: str, value: Any) -> float:
    """A value as a number; `AnnotationsError` if it is not one, or out of range."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not abs(number) <= _LARGEST_NUMBER:
        shown = "missing" if value is None else repr(value)[:_LONGEST_VALUE]
        raise AnnotationsError(f"{file}: {name} is {shown}, not a number")
    return number


def whole(file: str | Path, name: str, value: Any) -> int:
    """A value as a number of a frame or track; `AnnotationsError` if it is not one."""
    number = finite(file, name, value)
    if not number.is_integer() or not 0 <= number <= _LAST_FRAME:
        raise AnnotationsError(
            f"{file}: {name} is {number:g}, not a whole number from 0 to {_LAST_FRAME}"
        )
    return int(number)
