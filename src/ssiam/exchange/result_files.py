"""`read_annotations`: reads the .csv and .jsonl files of ``ssiam track``, checking every line."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Final, TypeAlias

from ssiam.errors import AnnotationsError, ArgumentError
from ssiam.exchange.annotations import NO_BOX, Annotation, Annotations
from ssiam.parsing import parse_json
from ssiam.video.mask_codec import check_mask
from ssiam.video.results import COLUMNS, MASK_COLUMN

_Record: TypeAlias = Mapping[str, float | None]
_Line: TypeAlias = tuple[_Record, str | None]  # values, and the mask

_REQUIRED: Final = COLUMNS[: COLUMNS.index("y4") + 1]
_OPTIONAL: Final = ("keyframe",)  # absent in files of earlier versions
_READ: Final = (*_REQUIRED, *_OPTIONAL)
_LONGEST_LINE: Final = 2048  # bytes without a mask; those written by ssiam have less than 500
_LONGEST_MASK: Final = 1 << 20  # bytes; an outline of 100,000 pixels has less
_CSV_WITH_MASKS: Final = f",{MASK_COLUMN}".encode()  # end of the header
_JSON_MASK: Final = f'"{MASK_COLUMN}": "'.encode()
_MOST_LINES: Final = 1_000_000  # nine hours of one target at 30 frames per second
_LARGEST_NUMBER: Final = 1e12  # whose square every format can still represent
_LONGEST_VALUE: Final = 40  # characters of a bad value that a message quotes
# Exports contain one line per frame up to the last one.
_LAST_FRAME: Final = 999_999
_LAST_TARGET: Final = 1000
_FREE_FRAMES: Final = 100_000  # an hour at 30 frames per second
_FRAMES_PER_ROW: Final = 1000


def read_annotations(
    path: str | Path,
    size_wh: tuple[int, int],
    fps: float | Fraction,
    names: Sequence[str] | None = None,
    max_frames: int | None = None,
) -> Annotations:
    """Read a .csv or .jsonl file written by ``ssiam track --results``.

    Parameters
    ----------
    path : str or Path
        Not trusted: the length and number of its lines are limited, and each value is checked.
    size_wh : (int, int)
        Width and height of the video's frames, pixels.
    fps : float or Fraction
        Frames per second.
    names : sequence of str, optional
        One per target; "target 1", "target 2", ... by default.
    max_frames : int, optional
        The most frames of the video. By default 100,000 and 1000 for each row, and as many
        frames of all targets together: exports contain every frame up to the last one.

    Returns
    -------
    Annotations

    Raises
    ------
    AnnotationsError
        The file is missing, damaged, or of another kind; one line with file and line number.
    ArgumentError
        The number of `names` differs from that of the targets, or `size_wh` or `fps` is
        impossible.
    """
    rows: dict[tuple[int, int], Annotation] = {}
    for number, (record, mask) in _read_records(Path(path)):
        try:
            row = _annotation(record, mask, size_wh)
        except ValueError as error:
            raise AnnotationsError(f"{path}: line {number}: {error}") from None
        if rows.setdefault((row.frame, row.target), row) is not row:
            raise AnnotationsError(
                f"{path}: line {number}: target {row.target} is in frame {row.frame} a second time"
            )
    targets = max((target for _, target in rows), default=0)
    if names is not None and len(names) != targets:
        raise ArgumentError(
            f"{len(names)} names for the {targets} targets of {path}: give one name per target"
        )
    _check_frames(path, rows, max_frames)
    named = [f"target {i}" for i in range(1, targets + 1)] if names is None else names
    return Annotations(size_wh, fps, tuple(named), tuple(rows.values()))


def _check_frames(
    path: str | Path, rows: Mapping[tuple[int, int], Annotation], max_frames: int | None
) -> None:
    """Refuse frame numbers that would make exports much larger than the file."""
    frames = 1 + max((frame for frame, _ in rows), default=-1)
    targets = len({target for _, target in rows})
    limit = _FREE_FRAMES + _FRAMES_PER_ROW * len(rows)
    if frames > max_frames if max_frames is not None else frames * targets > limit:
        raise AnnotationsError(
            f"{path}: {len(rows)} rows of {targets} targets, but {frames} frames: if the video has "
            f"as many, give --max-frames {frames}"
        )


def _annotation(record: _Record, mask: str | None, size_wh: tuple[int, int]) -> Annotation:
    """The annotation of a line; `ValueError` with the reason if it is invalid."""
    if mask is not None:
        check_mask(mask, size_wh)
    x, y, w, h = (record[name] for name in "xywh")
    points = [record[f"{axis}{number}"] for number in "1234" for axis in "xy"]
    known = [value for value in points if value is not None]
    has_box = x is not None and y is not None and w is not None and h is not None
    is_waiting = not has_box and record["lost"] is None
    return Annotation(
        _whole(record, "frame", 0, _LAST_FRAME),
        record["time"],
        _whole(record, "target", 1, _LAST_TARGET),
        (x, y, w, h) if has_box else NO_BOX,  # type: ignore[arg-type]
        tuple(zip(known[::2], known[1::2], strict=True)) if len(known) == len(points) else None,
        record["score"] or 0.0,
        is_waiting or bool(_whole(record, "lost", 0, 1)) or not has_box,
        record["keyframe"] is not None and bool(_whole(record, "keyframe", 0, 1)),
        mask,
    )


def _whole(record: _Record, name: str, lowest: int, highest: int) -> int:
    value = record[name]
    if value is None or not value.is_integer() or not lowest <= value <= highest:
        text = "missing" if value is None else f"{value:g}"
        raise ValueError(f"{name} is {text}, not a whole number from {lowest} to {highest}")
    return int(value)


def _read_records(path: Path) -> Iterator[tuple[int, _Line]]:
    """Line number, values by column, and mask of every line.

    Values are finite, or None if they are missing; booleans are 0 and 1.

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


def _parser(path: Path, lines: Iterator[tuple[int, bytes]]) -> Callable[[str], _Line]:
    suffix = path.suffix.lower()
    if suffix == ".jsonl":
        return _json_values
    if suffix != ".csv":
        raise AnnotationsError(
            f"{path}: unknown kind of results; give a .csv or .jsonl of ssiam track --results"
        )
    _, header = next(lines, (1, b""))
    columns = header.decode("utf-8-sig", errors="replace").strip().split(",")
    missing = [name for name in _REQUIRED if name not in columns]
    if missing:
        raise AnnotationsError(
            f"{path}: line 1 has no column {missing[0]!r}; is it a file of ssiam track --results?"
        )
    return partial(_csv_values, columns)


def _lines(path: Path) -> Iterator[tuple[int, bytes]]:
    try:
        with path.open("rb") as file:
            has_masks = False
            for number in count(1):
                line = file.readline(_LONGEST_LINE + 1)
                if not line:
                    return
                has_masks |= number == 1 and line.rstrip().endswith(_CSV_WITH_MASKS)
                if len(line) > _LONGEST_LINE and (has_masks or _JSON_MASK in line):
                    line += file.readline(_LONGEST_MASK)
                    if len(line) > _LONGEST_MASK:
                        raise AnnotationsError(
                            f"{path}: line {number} has over {_LONGEST_MASK} bytes"
                        )
                    yield number, line
                    continue
                if len(line) > _LONGEST_LINE:
                    raise AnnotationsError(f"{path}: line {number} has over {_LONGEST_LINE} bytes")
                if number > _MOST_LINES:
                    raise AnnotationsError(
                        f"{path}: line {number}: over {_MOST_LINES} lines; split the file"
                    )
                yield number, line
    except OSError as error:
        raise AnnotationsError(f"{path}: cannot be read ({error.strerror})") from None


def _csv_values(columns: Sequence[str], line: str) -> _Line:
    words = line.strip().split(",")
    if len(words) != len(columns):
        raise ValueError(f"has {len(words)} values, but the header has {len(columns)}")
    values = dict(zip(columns, words, strict=True))
    words_by_name = {name: values.get(name, "").strip() or None for name in _READ}
    record = {name: _number(name, word) for name, word in words_by_name.items()}
    return record, values.get(MASK_COLUMN) or None


def _json_values(line: str) -> _Line:
    values = parse_json(line)
    if not isinstance(values, dict):
        raise ValueError("is not a JSON object")
    missing = [name for name in _REQUIRED if name not in values]
    if missing:
        raise ValueError(f"has no {missing[0]!r}")
    wrong = [name for name in _READ if isinstance(values.get(name), str | list | dict)]
    if wrong:
        raise ValueError(f"{wrong[0]} is {str(values[wrong[0]])[:_LONGEST_VALUE]!r}, not a number")
    mask = values.get(MASK_COLUMN)
    if mask is not None and not isinstance(mask, str):
        raise ValueError(f"mask is {str(mask)[:_LONGEST_VALUE]!r}, not text")
    return {name: _number(name, values.get(name)) for name in _READ}, mask or None


def _number(name: str, value: Any) -> float | None:
    if value is None:
        return None
    try:
        number = float(value)
    except ValueError:
        raise ValueError(f"{name} is {value[:_LONGEST_VALUE]!r}, not a number") from None
    if not math.isfinite(number) or abs(number) > _LARGEST_NUMBER:
        raise ValueError(f"{name} is {number}, which is out of range")
    return number


def _reason(error: Exception) -> str:
    if isinstance(error, json.JSONDecodeError):
        return f"is not JSON ({error.msg}); is it cut off?"
    if isinstance(error, UnicodeDecodeError):
        return "is not text"
    return str(error)
