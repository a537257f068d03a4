"""YOLO: images/train/1.jpg and labels/train/1.txt, an object a line in shares of the picture.

``class cx cy w h`` is a box, ``class x1 y1 x2 y2 ...`` a polygon. A picture without a text has no
objects.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ssiam.datasets import DatasetError
from ssiam.datasets.files import read_text
from ssiam.training.folders import by_stem, files_below, first_folder, stem_in
from ssiam.training.outlines import Polygons
from ssiam.training.skipping import Skipped
from ssiam.training.sources import Names, TrainingTrack
from ssiam.training.stills import Still

# Numbers of a line: a box, or the corners of at least a triangle.
_BOX, _TRIANGLE = 4, 6
# Shares may lie this far outside of the picture, by rounding and by boxes that are cut off.
_OUTSIDE = 1.0


def read_yolo(folder: Path, names: Names) -> list[TrainingTrack]:
    """Every object as a track of one frame; `names` are those of the texts: train/1.

    Raises
    ------
    DatasetError
        A folder is missing, or more than a tenth of the texts are damaged or lack their picture;
        the others are left out with a warning.
    """
    texts = first_folder(folder, ("labels",))
    pictures = by_stem(first_folder(folder, ("images",)))
    skipped = Skipped(folder)
    tracks: list[TrainingTrack] = []
    for path in files_below(texts, (".txt",)):
        stem = stem_in(texts, path)
        if stem in names:
            with skipped.one():
                if stem not in pictures:
                    raise DatasetError(f"{path}: there is no picture {stem}")
                tracks += _objects(path, pictures[stem])
    skipped.tell()
    return tracks


def _objects(path: Path, picture: Path) -> list[Still]:
    lines = enumerate(read_text(path).splitlines(), start=1)
    return [_object(line, f"{path}: line {n}", picture) for n, line in lines if line.strip()]


def _object(line: str, where: str, picture: Path) -> Still:
    try:
        numbers = np.array(line.split()[1:], dtype=np.float64)
    except ValueError:
        raise DatasetError(f"{where} is {line[:40]!r}, not a class and numbers") from None
    count = len(numbers)
    if count != _BOX and (count < _TRIANGLE or count % 2):
        raise DatasetError(f"{where} has {count} numbers, neither a box nor a polygon")
    if not (np.abs(numbers - 0.5) <= 0.5 + _OUTSIDE).all():
        raise DatasetError(f"{where} has numbers that are no shares of a picture")
    if count == _BOX:
        cx, cy, w, h = numbers.tolist()
        if not (w > 0 and h > 0):
            raise DatasetError(f"{where} has a box without area")
        return Still(picture, (cx, cy, w, h), as_shares=True)
    ring = numbers.reshape(-1, 2)
    low, high = ring.min(axis=0), ring.max(axis=0)
    (cx, cy), (w, h) = ((low + high) / 2).tolist(), (high - low).tolist()
    outline = Polygons((ring.astype(np.float32),), as_shares=True)
    return Still(picture, (cx, cy, w, h), outline, as_shares=True)
