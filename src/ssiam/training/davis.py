"""DAVIS 2016 and 2017: JPEGImages/480p/bear/00000.jpg and Annotations/480p/bear/00000.png.

2016 tells one object in white, 2017 several in the colours of a palette; all of them are to be
seen in the first picture.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ssiam.datasets import DatasetError
from ssiam.datasets.files import images_in
from ssiam.training.clips import LabelledClip
from ssiam.training.folders import first_folder
from ssiam.training.pictures import label_picture
from ssiam.training.skipping import Skipped
from ssiam.training.sources import Names, TrainingTrack

# The smaller pictures first: crops have 255 pixels.
_SIZES = ("480p", "Full-Resolution", "1080p", "")


def read_davis(folder: Path, names: Names) -> list[TrainingTrack]:
    """A track for every object of every video; `names` are those of the videos.

    Raises
    ------
    DatasetError
        A folder is missing, or more than a tenth of the videos lack masks; the others are left
        out with a warning.
    """
    pictures = first_folder(folder, [f"JPEGImages/{size}".rstrip("/") for size in _SIZES])
    labels = first_folder(folder, [f"Annotations/{size}".rstrip("/") for size in _SIZES])
    skipped = Skipped(folder)
    tracks: list[TrainingTrack] = []
    for video in sorted(path.name for path in pictures.iterdir() if path.is_dir()):
        if video in names:
            with skipped.one():
                tracks += _objects(pictures / video, labels / video)
    skipped.tell()
    return tracks


def _objects(pictures: Path, labels: Path) -> list[LabelledClip]:
    paths, masks = labelled_pictures(pictures, labels)
    found = np.unique(label_picture(masks[0]))
    return [LabelledClip(pictures, paths, masks, int(label)) for label in found if label]


def labelled_pictures(pictures: Path, labels: Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """The pictures of a video that have labels, and these; `DatasetError` if there are none."""
    by_name = {path.stem: path for path in images_in(labels)}
    paths = tuple(path for path in images_in(pictures) if path.stem in by_name)
    if not paths:
        raise DatasetError(f"{labels}: holds no mask of any picture in {pictures}")
    return paths, tuple(by_name[path.stem] for path in paths)
