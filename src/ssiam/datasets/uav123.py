"""UAV123 (30 and 10 frames a second) and UAV20L.

data_seq/UAV123/VIDEO/000001.jpg and anno/UAV123/NAME.txt, where several sequences may be parts of
one video; or one sequence alone, NAME.txt among its images. Boxes may be nan.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.boxes import located, read_xywh
from ssiam.datasets.clips import read_clip
from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.errors import DatasetError
from ssiam.datasets.files import images_in, named_like, numbered
from ssiam.datasets.labels import read_flags
from ssiam.datasets.pairing import frames_by_number
from ssiam.datasets.sequence import Sequence
from ssiam.datasets.uav123_ranges import PARTS

EXPECTS = "anno/UAV123/NAME.txt and data_seq/UAV123/NAME/000001.jpg"
SPLITS = ("uav123", "uav20l", "uav123_10fps")

# Its authors do not say from where pixels count; all toolkits leave the boxes as they stand.
_ORIGIN = 0
_FOLDERS = {"uav123": "UAV123", "uav20l": "UAV20L", "uav123_10fps": "UAV123_10fps"}
_TEN_FPS = "UAV123_10fps"
# Of three images one, the first included, is left at 10 frames a second.
_TEN_FPS_STEP = 3
_NAME_DIGITS = 6
# In the order of the files anno/UAV123/att/NAME.txt.
_ATTRIBUTES = (
    "scale_variation",
    "aspect_ratio_change",
    "low_resolution",
    "fast_motion",
    "full_occlusion",
    "partial_occlusion",
    "out_of_view",
    "background_clutter",
    "illumination_variation",
    "viewpoint_change",
    "camera_motion",
    "similar_object",
)


def sequences_in(folder: Path, options: Options) -> Readers:
    """The sequences of the whole dataset in `folder`, or the one that it is."""
    if (folder / "anno").is_dir() and (folder / "data_seq").is_dir():
        part = _part(folder, options.split)
        truths = sorted(_either(folder / "anno", part).glob("*.txt"))
        return {path.stem: partial(_of_video, folder, part, path, options) for path in truths}
    own = named_like(folder)
    if own is None or not any(folder.glob("[0-9]" * _NAME_DIGITS + ".*")):
        return {}
    return {folder.name: partial(read_clip, folder, own, options.as_published)}


def _part(folder: Path, split: str | None) -> str:
    """The folder name of the wanted version, or of the first one that is here."""
    if split is not None:
        return _FOLDERS[split]
    here = (name for name in _FOLDERS.values() if (folder / "anno" / name).is_dir())
    fallback = _TEN_FPS if "10fps" in folder.name else "UAV123"
    return next(here, fallback)


def _either(folder: Path, part: str) -> Path:
    """The folder of a version; where one was got alone, its files lie right in `folder`."""
    return folder / part if (folder / part).is_dir() else folder


def _of_video(root: Path, part: str, truth_path: Path, options: Options) -> Sequence:
    """One sequence of the whole dataset; of a longer video, the images that have boxes."""
    boxes = read_xywh(truth_path)
    name = truth_path.stem
    # UAV20L has the whole videos, under the names of their folders.
    video, first, last = PARTS.get(name, (name, 1, len(boxes)))
    if name in PARTS and part == _TEN_FPS:
        first, last = ((number - 1) // _TEN_FPS_STEP + 1 for number in (first, last))
    if len(boxes) != last - first + 1:
        raise DatasetError(
            f"{truth_path}: holds {len(boxes)} boxes, but {name} goes from image {first} to {last}"
        )
    images = _video_folder(root, part, video)
    frames = frames_by_number(images, numbered(images_in(images)), first, len(boxes))
    return Sequence(
        name,
        frames,
        boxes if options.as_published else located(boxes, _ORIGIN),
        tags=_tags(truth_path, len(boxes)),
    )


def _video_folder(root: Path, part: str, video: str) -> Path:
    # UAV20L uses the images of UAV123.
    data = root / "data_seq"
    places = (data / part / video, data / "UAV123" / video, data / video)
    return next((path for path in places if path.is_dir()), places[0])


def _tags(truth_path: Path, count: int) -> dict[str, NDArray[np.bool_]]:
    path = truth_path.parent / "att" / truth_path.name
    if not path.is_file():
        return {}
    flags = read_flags(path, len(_ATTRIBUTES))
    return {
        tag: np.ones(count, dtype=bool) for tag, on in zip(_ATTRIBUTES, flags, strict=True) if on
    }
