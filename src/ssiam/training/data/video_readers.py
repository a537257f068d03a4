"""Readers of annotated videos: DAVIS, YouTube-VOS, MOTChallenge, and `ssiam.datasets`.

Damaged videos are skipped, see `AnnotationErrors`. Track folders are read by
`ssiam.training.data.track_folders`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import Dataset, DatasetError, VideoSequence
from ssiam.datasets.files import images_in, inside, read_text
from ssiam.datasets.mot import MotClip, clip_folders, read_clip
from ssiam.geometry import XYWH
from ssiam.parsing import is_number_word, parse_json
from ssiam.training.data.files import AnnotationErrors, first_folder
from ssiam.training.data.images import read_labels
from ssiam.training.data.tracks import BoxTrack, LabelTrack, NameFilter, TrainingTrack

__all__ = ["SequenceSource", "read_davis", "read_mot", "read_youtube_vos"]

# DAVIS's resolutions, the smallest first: crops have 255 px.
_DAVIS_SIZES: Final = ("480p", "Full-Resolution", "1080p", "")

_YOUTUBE_META: Final = "meta.json"
_MAX_DIGITS: Final = 9  # of the number of an object
_YOUTUBE_MAX_BYTES: Final = 1 << 27  # of meta.json

_MOT_MIN_VISIBLE: Final = 0.4  # visible fraction below which an object counts as hidden

_HIDDEN_TAGS: Final = ("full_occlusion", "out_of_view", "absence")
_CACHED_SEQUENCES: Final = 64  # reading a sequence again takes as long as a few images


def read_davis(folder: Path, names: NameFilter) -> list[TrainingTrack]:
    """DAVIS 2016 and 2017: JPEGImages/480p/bear/00000.jpg, Annotations/480p/bear/00000.png.

    The 2016 annotations show one object in white, those of 2017 several in palette colors. Each
    object that the first label image contains is one track.

    Parameters
    ----------
    folder : Path
    names : NameFilter
        Matches the videos.

    Raises
    ------
    DatasetError
        A folder is missing, or more than a tenth of the videos have no masks.
    """
    images = first_folder(folder, [f"JPEGImages/{size}".rstrip("/") for size in _DAVIS_SIZES])
    labels = first_folder(folder, [f"Annotations/{size}".rstrip("/") for size in _DAVIS_SIZES])
    errors = AnnotationErrors(folder)
    tracks: list[TrainingTrack] = []
    for video in sorted(path.name for path in images.iterdir() if path.is_dir()):
        if video in names:
            with errors.skip():
                tracks += _davis_tracks(images / video, labels / video)
    errors.check()
    return tracks


def _davis_tracks(images: Path, labels: Path) -> list[LabelTrack]:
    paths, label_paths = _labeled_images(images, labels)
    found = np.unique(read_labels(label_paths[0]))
    return [LabelTrack(images, paths, label_paths, int(label)) for label in found if label]


def _labeled_images(images: Path, labels: Path) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """The labeled images of a video, and their label images; `DatasetError` if there are none."""
    by_stem = {path.stem: path for path in images_in(labels)}
    paths = tuple(path for path in images_in(images) if path.stem in by_stem)
    if not paths:
        raise DatasetError(f"{labels}: holds no mask of any image in {images}")
    return paths, tuple(by_stem[path.stem] for path in paths)


def read_youtube_vos(folder: Path, names: NameFilter) -> list[TrainingTrack]:
    """YouTube-VOS: JPEGImages/VIDEO/00000.jpg, Annotations/VIDEO/00000.png, meta.json.

    Every fifth image has labels, the indices of a palette. meta.json lists the objects, which may
    appear and disappear.

    Parameters
    ----------
    folder : Path
    names : NameFilter
        Matches the videos.

    Raises
    ------
    DatasetError
        A folder or meta.json is missing or damaged, or more than a tenth of the videos are
        incomplete.
    """
    images, labels = (first_folder(folder, (name,)) for name in ("JPEGImages", "Annotations"))
    meta = folder / _YOUTUBE_META
    errors = AnnotationErrors(folder)
    tracks: list[TrainingTrack] = []
    for video, entry in sorted(_youtube_videos(meta).items()):
        if video in names:
            with errors.skip():
                tracks += _youtube_tracks(video, entry, meta, images, labels)
    errors.check()
    return tracks


def _youtube_videos(meta: Path) -> dict[str, Any]:
    try:
        content = parse_json(read_text(meta, _YOUTUBE_MAX_BYTES))
    except ValueError as error:
        raise DatasetError(f"{meta}: is not valid JSON ({error})") from None
    videos = content.get("videos") if isinstance(content, dict) else None
    if not isinstance(videos, dict):
        raise DatasetError(f"{meta}: holds no list of videos")
    return videos


def _is_object_number(word: str) -> bool:
    return is_number_word(word) and len(word) <= _MAX_DIGITS


def _youtube_tracks(
    video: str, entry: Any, meta: Path, images: Path, labels: Path
) -> list[LabelTrack]:
    objects = entry.get("objects") if isinstance(entry, dict) else None
    if not isinstance(objects, dict) or not all(map(_is_object_number, objects)):
        raise DatasetError(f"{meta}: the video {video!r} has no numbered objects")
    folder = inside(images, video, meta)
    paths, label_paths = _labeled_images(folder, inside(labels, video, meta))
    return [LabelTrack(folder, paths, label_paths, int(key)) for key in objects]


def read_mot(folder: Path, names: NameFilter) -> list[TrainingTrack]:
    """MOTChallenge: NAME/img1/000001.jpg and NAME/gt/gt.txt, several objects in the same frames.

    Each object of a clip is a track with all frames of the clip. `ssiam.datasets.mot` documents
    the format and which objects are read.

    Parameters
    ----------
    folder : Path
        A clip, or clips in it or in its subfolders.
    names : NameFilter
        Matches the clips.

    Raises
    ------
    DatasetError
        There is no clip, or more than a tenth of the clips are damaged.
    """
    errors = AnnotationErrors(folder)
    tracks: list[TrainingTrack] = []
    for path in clip_folders(folder):
        if path.resolve().name in names:
            with errors.skip():
                tracks += _mot_tracks(read_clip(path, min_visibility=_MOT_MIN_VISIBLE))
    errors.check()
    return tracks


def _mot_tracks(clip: MotClip) -> list[BoxTrack]:
    paths = clip.paths(0)
    last = max((each.span[1] for each in clip.objects), default=-1)
    if last >= len(paths):
        raise DatasetError(
            f"{clip.folder}: {len(paths)} images, but boxes up to frame {last + 1}; get it again"
        )
    folder = clip.images.resolve()
    return [
        BoxTrack(folder, paths, _boxes_or_none(each.boxes(0, len(paths)))) for each in clip.objects
    ]


def _boxes_or_none(xywh: NDArray[np.float64]) -> tuple[XYWH | None, ...]:
    rows: list[list[float]] = xywh.tolist()
    return tuple(None if math.isnan(x) else (x, y, w, h) for x, y, w, h in rows)


class SequenceSource:
    """A `Source` of the sequences of a tracking dataset: GOT-10k, LaSOT, OTB and others.

    A sequence is read when its track is first requested; the last few are cached.

    Parameters
    ----------
    name : str
    dataset : Dataset
    names : NameFilter
        Matches the sequences.
    weight : float
    alike : bool
    """

    def __init__(
        self,
        name: str,
        dataset: Dataset,
        names: NameFilter,
        weight: float = 1.0,
        alike: bool = False,
    ) -> None:
        self.name = name
        self.weight = weight
        self.alike = alike
        self._dataset = dataset
        self._names = [name for name in dataset.sequences if name in names]
        self._cache: dict[str, BoxTrack] = {}

    def __len__(self) -> int:
        return len(self._names)

    def track(self, i: int) -> BoxTrack:
        """The track of a sequence.

        Raises
        ------
        DatasetError
            Its files are damaged, or it is a video file, which has no random access.
        """
        name = self._names[i]
        if name not in self._cache:
            if len(self._cache) >= _CACHED_SEQUENCES:
                del self._cache[next(iter(self._cache))]
            self._cache[name] = _sequence_track(self._dataset.sequences[name])
        return self._cache[name]

    def distractors(self, i: int) -> Sequence[int]:
        """Empty: a sequence annotates one object."""
        return ()


def _sequence_track(sequence: VideoSequence) -> BoxTrack:
    if not isinstance(sequence.frames, tuple):
        raise DatasetError(f"{sequence.frames}: is a video; write its frames as images to train")
    boxes = tuple(_visible_box(sequence, t) for t in range(len(sequence.frames)))
    return BoxTrack(sequence.frames[0].parent.resolve(), sequence.frames, boxes)


def _visible_box(sequence: VideoSequence, t: int) -> XYWH | None:
    """The box of a frame; None without one, or where a tag marks the target as hidden."""
    if t >= len(sequence.truth) or not np.isfinite(sequence.truth[t]).all():
        return None
    hidden = any(sequence.tags[tag][t] for tag in _HIDDEN_TAGS if tag in sequence.tags)
    return None if hidden else sequence.box(t)
