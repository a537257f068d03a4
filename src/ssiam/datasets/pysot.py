"""pysot's JSON files (VOT2018.json, ...): all boxes and tags of a dataset in one file.

The images are searched for next to the file, and in a folder of its name. They may be missing: raw
results are scored without them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.dataset import Readers
from ssiam.datasets.files import check_counts, inside, read_text
from ssiam.datasets.ground_truth import stack_rows
from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import DatasetError
from ssiam.parsing import parse_json

EXPECTS = "a .json with img_names and gt_rect of each sequence"

# Bytes. VOT2018.json has 2.3 million; a decoded JSON file needs up to thirty times its size.
_MAX_BYTES = 16 * 1024 * 1024
_REQUIRED = ("img_names", "gt_rect")
_MAX_PIXEL = 1e9  # integers in JSON may exceed the range of floats
_MAX_NAME = 100  # characters of the name of a sequence
_MAX_TAGS = 50  # of one sequence
# Lists that are not tags
_NOT_TAGS = (*_REQUIRED, "init_rect")

_Record = Mapping[str, Any]


def sequences_in_file(path: Path) -> Readers:
    """The sequences of a JSON file.

    Raises
    ------
    DatasetError
        It is not JSON, or has another form.
    """
    try:
        records = parse_json(read_text(path, _MAX_BYTES))
    except ValueError:
        raise DatasetError(f"{path}: is not JSON, or is truncated; get it again") from None
    if not isinstance(records, dict) or not records or not all(map(_is_record, records.values())):
        raise DatasetError(f"{path}: expected {EXPECTS}; get one of pysot's files")
    for name in records:
        # The name becomes the name of result files.
        if len(name) > _MAX_NAME or not name.isprintable() or Path(name).name != name:
            raise DatasetError(
                f"{path}: {name[:40]!r} is not a valid name of a sequence; rename it"
            )
    return {name: partial(_sequence, path, name, record) for name, record in records.items()}


def _is_record(record: object) -> bool:
    return isinstance(record, dict) and all(isinstance(record.get(key), list) for key in _REQUIRED)


def _sequence(path: Path, name: str, record: _Record) -> VideoSequence:
    where = f"{path}: {name}"
    images = _images(path, record)
    truth = stack_rows([_row(value, where) for value in record["gt_rect"]], where)
    check_counts(where, len(images), len(truth))
    return VideoSequence(
        name, images, truth, tags=_tags(record, len(truth), where), size_wh=_size_wh(record)
    )


def _images(path: Path, record: _Record) -> tuple[Path, ...]:
    """Paths in the first of the usual folders that has the sequence."""
    names = [str(name) for name in record["img_names"]]
    folders = (path.parent, path.parent / path.stem)
    found = (folder for folder in folders if names and inside(folder, names[0], path).is_file())
    root = next(found, path.parent)
    return tuple(inside(root, name, path) for name in names)


def _row(value: object, where: str) -> tuple[float, ...]:
    if isinstance(value, list) and len(value) in (4, 8) and all(map(_is_number, value)):
        return tuple(map(float, value))
    raise DatasetError(f"{where}: gt_rect has {str(value)[:40]!r}; expected 4 or 8 numbers")


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not abs(value) >= _MAX_PIXEL


def _tags(record: _Record, count: int, where: str) -> dict[str, NDArray[np.bool_]]:
    """Lists of 0 and 1 for each frame (all 0 if empty), and the names under "attr"."""
    lists = {
        key: value
        for key, value in record.items()
        if isinstance(value, list) and key not in _NOT_TAGS and key != "attr"
    }
    named = record.get("attr", [])
    if not isinstance(named, list) or len(lists) + len(named) > _MAX_TAGS:
        raise DatasetError(f"{where}: attr is not a list, or there are more than {_MAX_TAGS} tags")
    for key, value in lists.items():
        if len(value) not in (0, count) or not all(flag in (0, 1) for flag in value):
            raise DatasetError(f"{where}: {key[:40]!r} is not a 0 or 1 for each of {count} frames")
    tags = {key: np.array(value or [0] * count, dtype=bool) for key, value in lists.items()}
    return tags | {str(tag): np.ones(count, dtype=bool) for tag in named}


def _size_wh(record: _Record) -> tuple[int, int] | None:
    width, height = record.get("width"), record.get("height")
    return (width, height) if isinstance(width, int) and isinstance(height, int) else None
