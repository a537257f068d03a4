"""Ground truth files: boxes or polygons, and labels, one per frame."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.files import read_text
from ssiam.errors import DatasetError
from ssiam.geometry import corners_from_xywh

_SEPARATORS = re.compile(r"[\s,;]+")
_LABEL_SEPARATORS = re.compile(r"[\s,]+")
_LABEL = re.compile(r"\d{1,4}")
_MAX_SHOWN = 40  # characters of an invalid line in a message


def read_boxes(path: Path) -> NDArray[np.float64]:
    """The boxes of a file, (N, 4) x, y, w, h or (N, 8) corners, as in the file.

    Numbers are separated by commas, semicolons, tabs or spaces; ``nan`` means unknown.

    Raises
    ------
    DatasetError
        The file is missing, empty or too large, or a line is not 4 or 8 numbers.
    """
    return parse_boxes(read_text(path), path)


def parse_boxes(text: str, source: Path) -> NDArray[np.float64]:
    """As `read_boxes`, for the text of the file `source`."""
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip():
            row = _numbers(line)
            if row is None:
                shown = line.strip()[:_MAX_SHOWN]
                raise DatasetError(f"{source}: line {number} is {shown!r}, not 4 or 8 numbers")
            rows.append(row)
    return stack_rows(rows, source)


def stack_rows(rows: Iterable[tuple[float, ...]], source: Path | str) -> NDArray[np.float64]:
    """Rows of 4 or 8 numbers as one array (N, 4) or (N, 8); if both occur, boxes become corners.

    Raises
    ------
    DatasetError
        There are no rows; the message names `source`.
    """
    rows = list(rows)
    if not rows:
        raise DatasetError(f"{source}: has no boxes; get it again")
    if len({len(row) for row in rows}) > 1:
        rows = [_corners(row) for row in rows]
    return np.array(rows, dtype=np.float64)


def to_zero_based(xywh: NDArray[np.float64], origin: int) -> NDArray[np.float64]:
    """Convert boxes (N, 4) whose pixels count from `origin` (0 or 1) to 0-based boxes.

    Boxes without area, which mean an absent target in OTB, GOT-10k and LaSOT, become nan.
    """
    zero_based = xywh - (origin, origin, 0, 0)
    with np.errstate(invalid="ignore"):
        zero_based[~(xywh[:, 2:] > 0).all(axis=1)] = np.nan
    return zero_based


def read_xywh(path: Path) -> NDArray[np.float64]:
    """As `read_boxes`, for layouts without polygons."""
    boxes = read_boxes(path)
    if boxes.shape[1] != 4:
        raise DatasetError(f"{path}: has polygons; expected boxes x, y, w, h")
    return boxes


def _numbers(line: str) -> tuple[float, ...] | None:
    try:
        row = tuple(map(float, _SEPARATORS.split(line.strip(" \t,;\r\n"))))
    except ValueError:
        return None
    return row if len(row) in (4, 8) and not any(map(math.isinf, row)) else None


def _corners(row: tuple[float, ...]) -> tuple[float, ...]:
    return row if len(row) == 8 else tuple(corners_from_xywh(row).ravel())


def read_labels(path: Path, count: int, *, may_be_short: bool = False) -> NDArray[np.int64]:
    """The labels (count,) of a file, separated by line breaks, commas or spaces.

    Parameters
    ----------
    path : Path
    count : int
        Number of frames.
    may_be_short : bool
        Whether labels may be missing at the end, as in VOT; they are 0.

    Raises
    ------
    DatasetError
        The file is missing, has other values than small whole numbers, or a wrong number of them.
    """
    words = [word for word in _LABEL_SEPARATORS.split(read_text(path)) if word]
    bad = next((word for word in words if not _LABEL.fullmatch(word)), None)
    if bad is not None:
        raise DatasetError(f"{path}: has {bad[:_MAX_SHOWN]!r}; expected 0 or 1 for each frame")
    if len(words) > count or (len(words) < count and not may_be_short):
        raise DatasetError(f"{path}: has {len(words)} labels for {count} frames; get it again")
    labels = np.zeros(count, dtype=np.int64)
    labels[: len(words)] = [int(word) for word in words]
    return labels


def read_flags(path: Path, count: int, *, may_be_short: bool = False) -> NDArray[np.bool_]:
    """As `read_labels`, but (count,) bool: True where the label is not 0."""
    return read_labels(path, count, may_be_short=may_be_short).astype(np.bool_)
