"""User clips: a video or a folder of images, with a box file.

The box file is beside the video or folder, with the same name (walk.mp4, walk.txt), or is the only
.txt file among the images. It has 0-based x, y, width, height, or the eight numbers of a polygon,
for the first frame or for every frame.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import check_counts, image_folder, images_in
from ssiam.datasets.ground_truth import read_boxes, to_zero_based
from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import DatasetError
from ssiam.video import open_source
from ssiam.video.images import IMAGE_SUFFIXES

EXPECTS = "images with one .txt of boxes, or videos with a .txt of the same name beside each"

_VIDEO_SUFFIXES = (".mp4", ".m4v", ".mov", ".mkv", ".avi", ".webm", ".mpg", ".mpeg", ".ts")
_BOX_SUFFIX = ".txt"
_NOT_BOXES = ("list", "readme", "license")  # other text files next to images
_ORIGIN = 0


def sequences_in(folder: Path, options: Options) -> Readers:
    """The videos in `folder` that have boxes; if there are none, the folder's images as a clip."""
    videos = (path for path in sorted(folder.iterdir()) if is_video(path))
    readers = {
        path.stem: partial(read_clip, path, boxes, options.as_published)
        for path, boxes in ((path, path.with_suffix(_BOX_SUFFIX)) for path in videos)
        if boxes.is_file()
    }
    image_boxes = None if readers else _box_file(folder)
    if image_boxes is not None:
        readers[folder.name] = partial(read_clip, folder, image_boxes, options.as_published)
    return readers


def sequence_of_video(path: Path, options: Options) -> Readers:
    """The clip of a single video; raises `DatasetError` if it has no box file."""
    boxes = path.with_suffix(_BOX_SUFFIX)
    if not boxes.is_file():
        raise DatasetError(f"{path}: has no box file; write x,y,width,height into {boxes.name}")
    return {path.stem: partial(read_clip, path, boxes, options.as_published)}


def is_video(path: Path) -> bool:
    """Whether a path is a file with the suffix of a video."""
    return path.suffix.lower() in _VIDEO_SUFFIXES and path.is_file()


def read_clip(frames: Path, boxes: Path, as_published: bool = False) -> VideoSequence:
    """The sequence of a video or folder of images, with boxes for its first or for every frame.

    A video with a single box is decoded once, to count its frames.

    Parameters
    ----------
    frames : Path
        A video, or a folder of images.
    boxes : Path
        The box file; see `read_boxes`.
    as_published : bool
        Keep boxes without area; by default they become nan.

    Raises
    ------
    DatasetError
        The boxes are missing or damaged, or there is neither one box nor one for every image.
    SourceError
        The video cannot be read.
    """
    truth = read_boxes(boxes)
    if truth.shape[1] == 4 and not as_published:
        truth = to_zero_based(truth, _ORIGIN)
    if frames.is_dir():
        images = images_in(image_folder(frames))
        check_counts(frames, len(images), len(truth), one_is_enough=True)
        return VideoSequence(frames.name, images, truth)
    count = _count(frames) if len(truth) == 1 else len(truth)
    return VideoSequence(frames.stem, frames, truth, count=count)


def _count(video: Path) -> int:
    with open_source(video) as source:
        return sum(1 for _ in source)


def _box_file(folder: Path) -> Path | None:
    """The box file of a folder of images: next to it with its name, or the only one in it."""
    if not any(path.suffix.lower() in IMAGE_SUFFIXES for path in image_folder(folder).iterdir()):
        return None
    beside = folder.parent / f"{folder.name}{_BOX_SUFFIX}"
    if beside.is_file():
        return beside
    texts = (path for path in folder.glob(f"*{_BOX_SUFFIX}") if path.is_file())
    inner = [path for path in texts if path.stem.lower() not in _NOT_BOXES]
    return inner[0] if len(inner) == 1 else None
