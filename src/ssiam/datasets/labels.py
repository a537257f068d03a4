"""Label files: a whole number for every frame, mostly 0 or 1."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.errors import DatasetError
from ssiam.datasets.files import read_text

_SEPARATORS = re.compile(r"[\s,]+")
_LEVEL = re.compile(r"\d{1,4}")


def read_levels(path: Path, count: int, *, may_be_short: bool = False) -> NDArray[np.int64]:
    """The labels (count,) of a file, parted by lines, commas or spaces.

    Parameters
    ----------
    path : Path
    count : int
        Number of frames.
    may_be_short : bool
        Frames that are left out at the end are 0, as VOT has it.

    Raises
    ------
    DatasetError
        The file is missing, holds other than small whole numbers, or has a wrong count of them.
    """
    words = [word for word in _SEPARATORS.split(read_text(path)) if word]
    bad = next((word for word in words if not _LEVEL.fullmatch(word)), None)
    if bad is not None:
        raise DatasetError(f"{path}: holds {bad[:40]!r} where a 0 or 1 a frame was expected")
    if len(words) > count or (len(words) < count and not may_be_short):
        raise DatasetError(f"{path}: holds {len(words)} labels for {count} frames; get it again")
    levels = np.zeros(count, dtype=np.int64)
    levels[: len(words)] = [int(word) for word in words]
    return levels


def read_flags(path: Path, count: int, *, may_be_short: bool = False) -> NDArray[np.bool_]:
    """As `read_levels`, (count,) bool: True where the label is not 0."""
    return read_levels(path, count, may_be_short=may_be_short).astype(np.bool_)
