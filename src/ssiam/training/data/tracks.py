"""Tracks and sources of training data: one object over frames, and a set of such objects."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from ssiam.geometry import XYWH, Image
from ssiam.training.data.images import image_size, read_cached, read_labels
from ssiam.training.data.masks import Mask, Outline, box_of_fractions, box_of_mask

__all__ = [
    "BoxTrack",
    "LabelTrack",
    "NameFilter",
    "SingleImageTrack",
    "Source",
    "StillTrack",
    "TrackList",
    "TrainingTrack",
]

# Boxes of labels: of about 3000 videos of YouTube-VOS. A label image is decoded to find them.
_CACHED_BOXES: Final = 1 << 17


class TrainingTrack(Protocol):
    """One object over the frames of a video, or in a single image.

    Threads: any number of threads may read it.

    Frames count from 0. Boxes are 0-based px of the frame: x is the first column that the target
    covers, w the number of columns.
    """

    @property
    def frames(self) -> int:
        """Number of frames, at least 1."""

    @property
    def scene_ids(self) -> tuple[str, ...]:
        """Names of what its frames show; tracks with a common one may show the same object."""

    def image(self, t: int) -> Image:
        """Read-only frame (H, W, 3) uint8 BGR; `SsiamError` if its file is damaged."""

    def box(self, t: int) -> XYWH | None:
        """Box x, y, w, h of the target; None if it is hidden or not annotated."""

    def mask(self, t: int) -> Mask | None:
        """Mask (H, W) bool of the target; None if there is none."""


class Source(Protocol):
    """A set of tracks from which training samples.

    Threads: one thread at a time.
    """

    @property
    def name(self) -> str:
        """Its name in messages."""

    @property
    def weight(self) -> float:
        """Its share of the pairs, relative to the other sources."""

    @property
    def alike(self) -> bool:
        """Whether any two of its tracks may show the same object, as clips of one video do."""

    def __len__(self) -> int:
        """Number of tracks."""

    def track(self, i: int) -> TrainingTrack:
        """The track at an index; always the same."""

    def distractors(self, i: int) -> Sequence[int]:
        """Indices of the other tracks with the same frames."""


@dataclass(frozen=True)
class NameFilter:
    """Selects videos or images by shell patterns (``*``, ``?``, ``[ab]``) of their names.

    Attributes
    ----------
    only : tuple of str
        Names to include; empty includes all.
    without : tuple of str
        Names to exclude, even if `only` includes them.
    """

    only: tuple[str, ...] = ()
    without: tuple[str, ...] = ()

    def __contains__(self, name: str) -> bool:
        included = not self.only or any(fnmatchcase(name, pattern) for pattern in self.only)
        return included and not any(fnmatchcase(name, pattern) for pattern in self.without)


@dataclass(frozen=True, eq=False)
class TrackList:
    """A `Source` of a list of tracks.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
    tracks : sequence of TrainingTrack
    weight : float
    alike : bool
    """

    name: str
    tracks: Sequence[TrainingTrack]
    weight: float = 1.0
    alike: bool = False
    _by_scene: dict[tuple[str, ...], tuple[int, ...]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_scene", _group_by_scene(self.tracks))

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.tracks)

    def track(self, i: int) -> TrainingTrack:
        """The track at an index."""
        return self.tracks[i]

    def distractors(self, i: int) -> Sequence[int]:
        """Indices of the other tracks with the same frames."""
        return [j for j in self._by_scene.get(self.tracks[i].scene_ids, ()) if j != i]


def _group_by_scene(tracks: Sequence[TrainingTrack]) -> dict[tuple[str, ...], tuple[int, ...]]:
    """Indices of the tracks of each scene with several tracks."""
    indices: defaultdict[tuple[str, ...], list[int]] = defaultdict(list)
    for i, track in enumerate(tracks):
        indices[track.scene_ids].append(i)
    return {scene: tuple(found) for scene, found in indices.items() if len(found) > 1}


@dataclass(frozen=True, eq=False, slots=True)
class SingleImageTrack:
    """Base of tracks of one frame."""

    path: Path

    @property
    def frames(self) -> int:
        """Number of frames: 1."""
        return 1

    @property
    def scene_ids(self) -> tuple[str, ...]:
        """The image's path."""
        return (str(self.path),)

    def image(self, t: int) -> Image:
        """The image."""
        return read_cached(self.path)


@dataclass(frozen=True, eq=False, slots=True)
class StillTrack(SingleImageTrack):
    """An annotated object in a single image.

    Attributes
    ----------
    path : Path
        The image.
    xywh : (float, float, float, float), optional
        Box of the object, px; None for the bounding box of its outline.
    outline : Outline, optional
    as_fractions : bool
        `xywh` is center x, y, width and height in fractions of the image's size.
    """

    xywh: XYWH | None = None
    outline: Outline | None = None
    as_fractions: bool = False

    def box(self, t: int) -> XYWH | None:
        """The object's box; None if its outline is empty."""
        if self.xywh is None:
            mask = self.mask(t)
            return None if mask is None else box_of_mask(mask)
        if self.as_fractions:
            return box_of_fractions(self.xywh, image_size(self.image(t)))
        return self.xywh

    def mask(self, t: int) -> Mask | None:
        """The filled outline, if there is one."""
        return None if self.outline is None else self.outline.mask(image_size(self.image(t)))


@dataclass(frozen=True, eq=False)
class _VideoTrack:
    folder: Path
    paths: tuple[Path, ...]

    @property
    def scene_ids(self) -> tuple[str, ...]:
        """The folder."""
        return (str(self.folder),)

    @property
    def frames(self) -> int:
        """Number of images."""
        return len(self.paths)

    def image(self, t: int) -> Image:
        """The image of a frame."""
        return read_cached(self.paths[t])


@dataclass(frozen=True, eq=False)
class BoxTrack(_VideoTrack):
    """An object with a box in each frame that shows it.

    Attributes
    ----------
    folder : Path
        Folder of the images; the first image, if the folder contains other images too.
    paths : tuple of Path
        The images.
    boxes : tuple of (float, float, float, float) or None
        One per image; None where the target is hidden.
    """

    boxes: tuple[XYWH | None, ...]

    def box(self, t: int) -> XYWH | None:
        """The box of a frame."""
        return self.boxes[t]

    def mask(self, t: int) -> Mask | None:
        """None: the track has boxes only."""
        return None


@dataclass(frozen=True, eq=False)
class LabelTrack(_VideoTrack):
    """An object with a label image for each frame.

    Attributes
    ----------
    folder : Path
        Folder of the images.
    paths, labels : tuple of Path
        The images and their label images.
    label : int
        Label of the object, see `ssiam.training.data.images.read_labels`.
    """

    labels: tuple[Path, ...]
    label: int

    def box(self, t: int) -> XYWH | None:
        """The bounding box of the label; None where it does not occur."""
        return _box_of_label(self.labels[t], self.label)

    def mask(self, t: int) -> Mask:
        """The pixels with the label."""
        return _mask_of_label(self.labels[t], self.label)


def _mask_of_label(path: Path, label: int) -> Mask:
    return np.asarray(read_labels(path) == label)


@lru_cache(maxsize=_CACHED_BOXES)
def _box_of_label(path: Path, label: int) -> XYWH | None:
    return box_of_mask(_mask_of_label(path, label))
