"""YouTube-VOS: JPEGImages/VIDEO/00000.jpg, Annotations/VIDEO/00000.png, meta.json.

Every fifth picture has labels, the indices of a palette; objects come and go, and meta.json tells
which there are.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ssiam.datasets import DatasetError
from ssiam.datasets.files import inside, read_text
from ssiam.training.clips import LabelledClip
from ssiam.training.davis import labelled_pictures
from ssiam.training.folders import first_folder
from ssiam.training.skipping import Skipped
from ssiam.training.sources import Names, TrainingTrack

_META = "meta.json"
_LARGEST = 1 << 27  # bytes


def read_youtube_vos(folder: Path, names: Names) -> list[TrainingTrack]:
    """A track for every object of every video; `names` are those of the videos.

    Raises
    ------
    DatasetError
        A folder or meta.json is missing or damaged, or more than a tenth of the videos are not
        whole; the others are left out with a warning.
    """
    pictures, labels = (first_folder(folder, (name,)) for name in ("JPEGImages", "Annotations"))
    meta = folder / _META
    skipped = Skipped(folder)
    tracks: list[TrainingTrack] = []
    for video, entry in sorted(_videos(meta).items()):
        if video in names:
            with skipped.one():
                tracks += _objects(video, entry, meta, pictures, labels)
    skipped.tell()
    return tracks


def _videos(meta: Path) -> dict[str, Any]:
    try:
        content = json.loads(read_text(meta, _LARGEST))
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{meta}: is no JSON ({error})") from None
    videos = content.get("videos") if isinstance(content, dict) else None
    if not isinstance(videos, dict):
        raise DatasetError(f"{meta}: holds no list of videos")
    return videos


def _objects(
    video: str, entry: Any, meta: Path, pictures: Path, labels: Path
) -> list[LabelledClip]:
    objects = entry.get("objects") if isinstance(entry, dict) else None
    if not isinstance(objects, dict) or not all(key.isdecimal() for key in objects):
        raise DatasetError(f"{meta}: the video {video!r} has no numbered objects")
    folder = inside(pictures, video, meta)
    paths, masks = labelled_pictures(folder, inside(labels, video, meta))
    return [LabelledClip(folder, paths, masks, int(key)) for key in objects]
