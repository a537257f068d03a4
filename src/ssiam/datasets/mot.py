"""MOTChallenge: NAME/img1/000001.jpg, NAME/gt/gt.txt and optionally NAME/seqinfo.ini.

Each line of gt.txt is ``frame, id, x, y, w, h, flag[, class[, visibility]]``; frames and pixels
count from 1. Every object is a sequence, NAME-ID, from its first to its last visible frame, with
the boxes of the other objects (`VideoSequence.others`).

Objects with the flag 0 are not evaluated in MOTChallenge and are left out, as are classes that do
not move or are not objects (static person, distractor, occluder, reflection, crowd). Files with ten
columns (2D MOT 2015) have no classes; their last columns are world coordinates.
"""

from __future__ import annotations

import configparser
import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import (
    frames_by_number,
    images_in,
    inside,
    numbered,
    read_text,
    subfolders,
)
from ssiam.datasets.ground_truth import to_zero_based
from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import DatasetError
from ssiam.parsing import is_number_word

EXPECTS = "gt/gt.txt and img1/ in each clip's folder"

MIN_VISIBILITY: Final = 0.1  # visible share of an object below which it counts as hidden

_TRUTH: Final = "gt/gt.txt"
_INFO: Final = "seqinfo.ini"
_IMAGES: Final = "img1"
_ORIGIN: Final = 1
_MAX_DEPTH: Final = 2  # folders between the dataset and its clips: MOT17/train/MOT17-02-FRCNN
_MAX_BYTES: Final = 64 * 1024 * 1024  # of gt.txt; the largest of MOT20 has 30 million
# Bytes of seqinfo.ini; those of the challenge have 150. `configparser` takes a time that grows with
# the square of a line's length.
_MAX_INFO_BYTES: Final = 4096
_MIN_COLUMNS, _MAX_COLUMNS = 6, 10
_FLAG, _CLASS, _VISIBILITY = 6, 7, 8  # columns, from 0
# Moving classes of MOT16, MOT17 and MOT20: pedestrian, person on a vehicle, car, bicycle,
# motorbike, non-motorized vehicle. 7 to 13 are static persons, distractors, occluders,
# reflections and crowds.
_MOVING: Final = (1, 2, 3, 4, 5, 6)
_NO_CLASS: Final = -1
_MAX_NUMBER: Final = 10_000_000  # of a frame or an id; larger numbers mean that the file is damaged


@dataclass(frozen=True, eq=False)
class MotObject:
    """An object of a clip, in the frames in which it is visible.

    Attributes
    ----------
    number : int
        Its id in the file.
    frames : (K,) int64
        Ascending indices of the frames, from 0.
    xywh : (K, 4) float64
        Boxes in pixels, 0-based unless read as published.
    """

    number: int
    frames: NDArray[np.int64]
    xywh: NDArray[np.float64]

    @property
    def span(self) -> tuple[int, int]:
        """Indices of the first and the last frame with a box."""
        return int(self.frames[0]), int(self.frames[-1])

    def boxes(self, first: int, count: int) -> NDArray[np.float64]:
        """Boxes (count, 4) of the frames from `first` on, nan in frames without a box."""
        boxes = np.full((count, 4), np.nan)
        in_range = (self.frames >= first) & (self.frames < first + count)
        boxes[self.frames[in_range] - first] = self.xywh[in_range]
        return boxes


@dataclass(frozen=True, eq=False)
class MotClip:
    """A clip and the moving objects in it.

    Attributes
    ----------
    folder : Path
    images : Path
        The folder of its frames.
    objects : tuple of MotObject
        By id.
    size_wh : (int, int), optional
        Width and height of the frames, pixels, from seqinfo.ini.
    """

    folder: Path
    images: Path
    objects: tuple[MotObject, ...]
    size_wh: tuple[int, int] | None = None

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.resolve().name

    def name_of(self, target: MotObject) -> str:
        """Name of an object's sequence."""
        return f"{self.name}-{target.number}"

    def paths(self, first: int, count: int | None = None) -> tuple[Path, ...]:
        """The images of `count` frames from index `first` on, by default of all.

        Frames are numbered by the image names, or by their order if an image has another name.

        Raises
        ------
        DatasetError
            An image is missing.
        """
        images = images_in(self.images)
        by_number = numbered(images)
        if len(by_number) < len(images):
            by_number = dict(enumerate(images, _ORIGIN))
        count = max(by_number) - first if count is None else count
        return frames_by_number(self.images, by_number, first + _ORIGIN, count)


def sequences_in(folder: Path, options: Options) -> Readers:
    """The sequences of the clip in `folder`, one per object; reads its gt.txt."""
    if not is_clip(folder):
        return {}
    clip = read_clip(folder, as_published=options.as_published)
    return {clip.name_of(each): partial(_sequence, clip, each) for each in clip.objects}


def is_clip(folder: Path) -> bool:
    """Whether a folder is a clip of this layout with ground truth."""
    is_clip_folder = (folder / _IMAGES).is_dir() or (folder / _INFO).is_file()
    return is_clip_folder and (folder / _TRUTH).is_file()


def clip_folders(folder: Path) -> list[Path]:
    """`folder` itself if it is a clip, else the clips in it, else those in its subfolders.

    Raises
    ------
    DatasetError
        There are no clips.
    """
    folders = [folder] if folder.is_dir() else []
    for _ in range(_MAX_DEPTH + 1):
        found = [path for path in folders if is_clip(path)]
        if found:
            return found
        folders = [inner for outer in folders for inner in subfolders(outer)]
    raise DatasetError(f"{folder}: expected {EXPECTS}; check the path")


def read_clip(
    folder: Path, *, as_published: bool = False, min_visibility: float = MIN_VISIBILITY
) -> MotClip:
    """Read the ground truth of the clip in a folder; no image is opened.

    Parameters
    ----------
    folder : Path
    as_published : bool
        Return 1-based boxes.
    min_visibility : float
        0..1: boxes with a smaller visible share, and those without area, are left out.

    Raises
    ------
    DatasetError
        A file is missing or damaged, or an object has two boxes in one frame.
    """
    path = folder / _TRUTH
    rows = _rows(path)
    rows = rows[_is_target(rows) & (_visibility(rows) >= min_visibility)]
    xywh = rows[:, 2:6] if as_published else to_zero_based(rows[:, 2:6], _ORIGIN)
    has_area = (rows[:, 4:6] > 0).all(axis=1)
    objects = []
    for number in np.unique(rows[has_area, 1]):
        indices = np.flatnonzero(has_area & (rows[:, 1] == number))
        indices = indices[np.argsort(rows[indices, 0])]
        duplicates = np.flatnonzero(np.diff(rows[indices, 0]) == 0)
        if len(duplicates):
            frame = rows[indices[duplicates[0]], 0]
            raise DatasetError(
                f"{path}: frame {frame:g} has two boxes of the id {number:g}; remove one"
            )
        frames = rows[indices, 0].astype(np.int64) - _ORIGIN
        objects.append(MotObject(int(number), frames, xywh[indices]))
    info = _info(folder / _INFO)
    images = inside(folder, info.get("imdir") or _IMAGES, folder / _INFO)
    return MotClip(folder, images, tuple(objects), _size_wh(info))


def _sequence(clip: MotClip, target: MotObject) -> VideoSequence:
    first, last = target.span
    count = last - first + 1
    truth = target.boxes(first, count)
    others = {
        clip.name_of(each): each.boxes(first, count)
        for each in clip.objects
        if each is not target and each.span[0] <= last and each.span[1] >= first
    }
    return VideoSequence(
        clip.name_of(target), clip.paths(first, count), truth, size_wh=clip.size_wh, others=others
    )


def _rows(path: Path) -> NDArray[np.float64]:
    """The numbers (N, 6 to 10) of a ground truth file."""
    text = read_text(path, _MAX_BYTES)
    if not text.strip():
        raise DatasetError(f"{path}: has no boxes; get it again")
    try:
        rows = np.loadtxt(io.StringIO(text), delimiter=",", ndmin=2, comments=None)
    except ValueError as error:
        raise DatasetError(f"{path}: {str(error).partition(';')[0].rstrip('.')}") from None
    if not _MIN_COLUMNS <= rows.shape[1] <= _MAX_COLUMNS:
        raise DatasetError(
            f"{path}: has {rows.shape[1]} columns; expected {_MIN_COLUMNS} to {_MAX_COLUMNS}, "
            "frame,id,x,y,w,h,flag,class,visibility"
        )
    frame_and_id = rows[:, :2]
    valid = np.isfinite(rows[:, :6]).all(axis=1) & (abs(frame_and_id) <= _MAX_NUMBER).all(axis=1)
    valid &= (frame_and_id == np.round(frame_and_id)).all(axis=1) & (rows[:, 0] >= _ORIGIN)
    if not valid.all():
        number = int(np.flatnonzero(~valid)[0])
        shown = ",".join(f"{value:g}" for value in rows[number, :6])
        raise DatasetError(
            f"{path}: box {number + 1} is {shown}; expected a frame from 1 on, a whole id "
            "and four numbers"
        )
    return rows


def _is_target(rows: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each row (N,) is an evaluated object of a moving class."""
    is_target = np.ones(len(rows), dtype=np.bool_)
    if rows.shape[1] > _FLAG:
        is_target &= rows[:, _FLAG] != 0
    if _CLASS < rows.shape[1] < _MAX_COLUMNS:
        is_target &= np.isin(rows[:, _CLASS], (*_MOVING, _NO_CLASS))
    return is_target


def _visibility(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """The visible share (N,) of each box; 1 if the file has no visibility column."""
    if rows.shape[1] == _VISIBILITY + 1:
        shares = rows[:, _VISIBILITY]
        if ((shares >= 0) & (shares <= 1)).all():
            return shares
    return np.ones(len(rows))


def _info(path: Path) -> Mapping[str, str]:
    """The keys of seqinfo.ini in lower case; empty if there is no such file."""
    if not path.is_file():
        return {}
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(read_text(path, _MAX_INFO_BYTES))
    except configparser.Error as error:
        reason = str(error).splitlines()[0]
        raise DatasetError(f"{path}: is not an .ini file ({reason}); remove it") from None
    return parser["Sequence"] if parser.has_section("Sequence") else {}


def _size_wh(info: Mapping[str, str]) -> tuple[int, int] | None:
    sides = [info.get(key, "") for key in ("imwidth", "imheight")]
    if not all(is_number_word(side) and 0 < len(side) < 7 for side in sides):
        return None
    return int(sides[0]), int(sides[1])
