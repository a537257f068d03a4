"""UAV123 (30 and 10 frames per second) and UAV20L.

data_seq/UAV123/VIDEO/000001.jpg and anno/UAV123/NAME.txt, where several sequences may be parts of
one video; or a single sequence with NAME.txt among its images. Boxes may be nan.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.clips import read_clip
from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import frames_by_number, images_in, named_like, numbered
from ssiam.datasets.ground_truth import read_flags, read_xywh, to_zero_based
from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import DatasetError

EXPECTS = "anno/UAV123/NAME.txt and data_seq/UAV123/NAME/000001.jpg"
SPLITS = ("uav123", "uav20l", "uav123_10fps")

# The authors do not state whether boxes are 0-based or 1-based; toolkits do not change them.
_ORIGIN = 0
_VERSIONS = {"uav123": "UAV123", "uav20l": "UAV20L", "uav123_10fps": "UAV123_10fps"}
_TEN_FPS = "UAV123_10fps"
_TEN_FPS_STEP = 3  # every third image of 30 frames per second, from the first on
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
    """The sequences of the whole dataset in `folder`, or the single sequence that it is."""
    if (folder / "anno").is_dir() and (folder / "data_seq").is_dir():
        version = _version(folder, options.split)
        truths = sorted(_version_folder(folder / "anno", version).glob("*.txt"))
        return {path.stem: partial(_of_video, folder, version, path, options) for path in truths}
    truth_path = named_like(folder)
    if truth_path is None or not any(folder.glob("[0-9]" * _NAME_DIGITS + ".*")):
        return {}
    return {folder.name: partial(read_clip, folder, truth_path, options.as_published)}


def _version(folder: Path, split: str | None) -> str:
    """The folder name of the requested version, else of the first one that exists."""
    if split is not None:
        return _VERSIONS[split]
    found = (name for name in _VERSIONS.values() if (folder / "anno" / name).is_dir())
    fallback = _TEN_FPS if "10fps" in folder.name else "UAV123"
    return next(found, fallback)


def _version_folder(folder: Path, version: str) -> Path:
    """The folder of a version; a version downloaded alone is in `folder` itself."""
    return folder / version if (folder / version).is_dir() else folder


def _of_video(root: Path, version: str, truth_path: Path, options: Options) -> VideoSequence:
    """One sequence of the whole dataset: the images of the video that have boxes."""
    boxes = read_xywh(truth_path)
    name = truth_path.stem
    # UAV20L has whole videos, with the names of their folders.
    video, first, last = PARTS.get(name, (name, 1, len(boxes)))
    if name in PARTS and version == _TEN_FPS:
        first, last = ((number - 1) // _TEN_FPS_STEP + 1 for number in (first, last))
    if len(boxes) != last - first + 1:
        raise DatasetError(
            f"{truth_path}: has {len(boxes)} boxes, but {name} goes from image {first} to {last}"
        )
    images = _video_folder(root, version, video)
    frames = frames_by_number(images, numbered(images_in(images)), first, len(boxes))
    return VideoSequence(
        name,
        frames,
        boxes if options.as_published else to_zero_based(boxes, _ORIGIN),
        tags=_tags(truth_path, len(boxes)),
    )


def _video_folder(root: Path, version: str, video: str) -> Path:
    # UAV20L uses the images of UAV123.
    data = root / "data_seq"
    folders = (data / version / video, data / "UAV123" / video, data / video)
    return next((path for path in folders if path.is_dir()), folders[0])


def _tags(truth_path: Path, count: int) -> dict[str, NDArray[np.bool_]]:
    path = truth_path.parent / "att" / truth_path.name
    if not path.is_file():
        return {}
    flags = read_flags(path, len(_ATTRIBUTES))
    return {
        tag: np.ones(count, dtype=bool) for tag, on in zip(_ATTRIBUTES, flags, strict=True) if on
    }


# The sequences that are parts of a video, from the dataset's configuration file: folder of the
# video, first and last image at 30 frames per second. All others have a separate folder and begin
# at image 1.
PARTS: dict[str, tuple[str, int, int]] = {
    "bird1_1": ("bird1", 1, 253),
    "bird1_2": ("bird1", 775, 1477),
    "bird1_3": ("bird1", 1573, 2437),
    "car1_1": ("car1", 1, 751),
    "car1_2": ("car1", 751, 1627),
    "car1_3": ("car1", 1627, 2629),
    "car6_1": ("car6", 1, 487),
    "car6_2": ("car6", 487, 1807),
    "car6_3": ("car6", 1807, 2953),
    "car6_4": ("car6", 2953, 3925),
    "car6_5": ("car6", 3925, 4861),
    "car8_1": ("car8", 1, 1357),
    "car8_2": ("car8", 1357, 2575),
    "car16_1": ("car16", 1, 415),
    "car16_2": ("car16", 415, 1993),
    "group1_1": ("group1", 1, 1333),
    "group1_2": ("group1", 1333, 2515),
    "group1_3": ("group1", 2515, 3925),
    "group1_4": ("group1", 3925, 4873),
    "group2_1": ("group2", 1, 907),
    "group2_2": ("group2", 907, 1771),
    "group2_3": ("group2", 1771, 2683),
    "group3_1": ("group3", 1, 1567),
    "group3_2": ("group3", 1567, 2827),
    "group3_3": ("group3", 2827, 4369),
    "group3_4": ("group3", 4369, 5527),
    "person2_1": ("person2", 1, 1189),
    "person2_2": ("person2", 1189, 2623),
    "person4_1": ("person4", 1, 1501),
    "person4_2": ("person4", 1501, 2743),
    "person5_1": ("person5", 1, 877),
    "person5_2": ("person5", 877, 2101),
    "person7_1": ("person7", 1, 1249),
    "person7_2": ("person7", 1249, 2065),
    "person8_1": ("person8", 1, 1075),
    "person8_2": ("person8", 1075, 1525),
    "person12_1": ("person12", 1, 601),
    "person12_2": ("person12", 601, 1621),
    "person14_1": ("person14", 1, 847),
    "person14_2": ("person14", 847, 1813),
    "person14_3": ("person14", 1813, 2923),
    "person17_1": ("person17", 1, 1501),
    "person17_2": ("person17", 1501, 2347),
    "person19_1": ("person19", 1, 1243),
    "person19_2": ("person19", 1243, 2791),
    "person19_3": ("person19", 2791, 4357),
    "truck4_1": ("truck4", 1, 577),
    "truck4_2": ("truck4", 577, 1261),
    "uav1_1": ("uav1", 1, 1555),
    "uav1_2": ("uav1", 1555, 2377),
    "uav1_3": ("uav1", 2473, 3469),
}
