"""COCO: one JSON of pictures and objects, each with a box and polygons or runs of pixels.

The set is told by that file, with the pictures in a folder beside it or beside its folder, as
train2017/ lies beside annotations/instances_train2017.json.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ssiam.datasets import DatasetError
from ssiam.datasets.files import inside, read_text
from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.training.outlines import Outline, Polygons, Runs, unpacked_runs
from ssiam.training.skipping import Skipped
from ssiam.training.sources import Names, TrainingTrack
from ssiam.training.stills import Still

_LARGEST = 1 << 30  # bytes; that of COCO's training set is half of it


def read_coco(file: Path, names: Names) -> list[TrainingTrack]:
    """Every object but crowds as a track of one frame; `names` are those of the pictures' files.

    Raises
    ------
    DatasetError
        The file is missing or no such JSON, the pictures are not there, or more than a tenth of
        the objects are damaged; the others are left out with a warning.
    """
    pictures, objects = _content(file)
    folder = _picture_folder(file, pictures)
    paths = {key: inside(folder, name, file) for key, name in pictures.items()}
    skipped = Skipped(file)
    tracks: list[TrainingTrack] = []
    for entry in objects:
        with skipped.one():
            key = _field(entry, "image_id", (int, str), file)
            if key not in paths:
                raise DatasetError(f"{file}: an object lies in the picture {key}, which is none")
            if pictures[key] in names and not entry.get("iscrowd"):
                tracks.append(Still(paths[key], _box(entry, file), _outline(entry, file)))
    skipped.tell()
    return tracks


def _content(file: Path) -> tuple[dict[Any, str], list[Any]]:
    """File names by the pictures' numbers, and the objects."""
    try:
        content = json.loads(read_text(file, _LARGEST))
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{file}: is no JSON ({error})") from None
    if not isinstance(content, dict):
        raise DatasetError(f"{file}: holds no pictures and objects as COCO has them")
    images = _field(content, "images", (list,), file)
    objects = _field(content, "annotations", (list,), file)
    pictures = {
        _field(entry, "id", (int, str), file): _field(entry, "file_name", (str,), file)
        for entry in images
    }
    if not pictures:
        raise DatasetError(f"{file}: names no picture")
    return pictures, objects


def _picture_folder(file: Path, pictures: Mapping[Any, str]) -> Path:
    """The folder in which the first picture lies."""
    name = next(iter(pictures.values()))
    split = file.stem.rpartition("_")[2]
    roots = [file.parent, file.parent.parent]
    inner = ("", "images", split, f"images/{split}", "JPEGImages", "data")
    for folder in (root / part for root in roots for part in inner):
        if inside(folder, name, file).is_file():
            return folder.resolve()
    raise DatasetError(
        f"{file}: the picture {name!r} is neither beside it nor in {split} or images"
    )


def _field(entry: Any, name: str, kinds: tuple[type, ...], file: Path) -> Any:
    value = entry.get(name) if isinstance(entry, dict) else None
    if not isinstance(value, kinds):
        raise DatasetError(f"{file}: an entry lacks {name!r}, or has another kind of value there")
    return value


def _box(entry: Any, file: Path) -> XYWH:
    numbers = _numbers(_field(entry, "bbox", (list,), file), file)
    if numbers.shape != (4,) or not (numbers[2:] > 0).all():
        raise DatasetError(f"{file}: an object has the box {numbers.tolist()[:4]}")
    x, y, w, h = numbers.tolist()
    return x, y, w, h


def _outline(entry: Any, file: Path) -> Outline | None:
    shape = entry.get("segmentation")
    if not shape:
        return None
    if isinstance(shape, list):
        rings = [_numbers(ring, file) for ring in shape]
        if any(len(ring) < 6 or len(ring) % 2 for ring in rings):
            raise DatasetError(f"{file}: an object has a polygon of an odd or small number")
        return Polygons(tuple(ring.reshape(-1, 2).astype(np.float32) for ring in rings))
    counts = _field(shape, "counts", (str, list), file)
    height, width = _numbers(_field(shape, "size", (list,), file), file).astype(int).tolist()
    try:
        runs = unpacked_runs(counts) if isinstance(counts, str) else _numbers(counts, file)
        return Runs(runs.astype(np.int64), (width, height))
    except ArgumentError as error:
        raise DatasetError(f"{file}: {error}") from None


def _numbers(values: Any, file: Path) -> np.ndarray[Any, np.dtype[np.float64]]:
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise DatasetError(f"{file}: {str(values)[:40]} are not numbers") from None
    if numbers.ndim != 1 or not np.isfinite(numbers).all():
        raise DatasetError(f"{file}: {str(values)[:40]} is no list of finite numbers")
    return numbers
