"""The layouts of training sets, and `open_training_source`, which opens a set by its layout."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ssiam.datasets import KINDS, DatasetError, open_dataset
from ssiam.datasets.dataset import dataset_errors
from ssiam.errors import ArgumentError, check_choice
from ssiam.training.data.copy_paste import CopyPasteSource
from ssiam.training.data.files import images_by_stem, list_files
from ssiam.training.data.image_readers import (
    read_coco,
    read_mask_images,
    read_voc,
    read_voc_video,
    read_yolo,
)
from ssiam.training.data.random_patches import RandomPatchSource
from ssiam.training.data.track_folders import TrackFolderSource
from ssiam.training.data.tracks import NameFilter, Source, TrackList, TrainingTrack
from ssiam.training.data.video_readers import (
    SequenceSource,
    read_davis,
    read_mot,
    read_youtube_vos,
)

__all__ = ["LAYOUTS", "SourceSettings", "open_training_source"]

_READERS: Final[dict[str, Callable[[Path, NameFilter], list[TrainingTrack]]]] = {
    "coco": read_coco,
    "davis": read_davis,
    "masks": read_mask_images,
    "mot": read_mot,
    "voc": read_voc,
    "voc_video": read_voc_video,
    "yolo": read_yolo,
    "youtube_vos": read_youtube_vos,
}
LAYOUTS: Final = tuple(dict.fromkeys((*_READERS, "regions", "stamps", "tracks", *KINDS)))
_MAX_GAP: Final = 1000  # frames, the limit of `interpolate`


@dataclass(frozen=True)
class SourceSettings:
    """One set of training data, a table [[sources]].

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    layout : str
        One of `LAYOUTS`: "coco", "davis", "masks", "mot", "voc", "voc_video" (images that are
        consecutive frames), "yolo", "youtube_vos"; "regions" (random patches of any images),
        "stamps" (copy-paste objects, PNGs with alpha), "tracks" (track folders with a meta.json);
        or a kind of `ssiam.datasets.open_dataset`: "got10k", "lasot", "clip", ...
    path : str
        Its folder; for "coco" the JSON file.
    weight : float
        Its share of the pairs, relative to the other sets.
    name : str
        Used in messages; empty for the name of its folder or file.
    split : str, optional
        For the kinds of `open_dataset` that have splits.
    only, without : tuple of str
        Patterns of the names of videos or images to include or exclude; for "tracks" of the
        videos, "SET/VIDEO".
    backgrounds : tuple of str
        For "stamps": folders of background images.
    alike : bool
        Whether two videos or images of the set may show the same object, as in a set of few
        scenes. Negatives are then always drawn from another set.
    rivals : float
        For "stamps": fraction 0..1 of the scenes with distractors of similar size.
    tumbling : float
        For "stamps": fraction 0..1 of the scenes whose target has arbitrary rotations.
    interpolate : int
        For "tracks": largest distance between two annotated frames for which a distractor's box
        is interpolated.

    Raises
    ------
    ArgumentError
        The layout is unknown, or an option is invalid for it.
    """

    layout: str
    path: str
    weight: float = 1.0
    name: str = ""
    split: str | None = None
    only: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    backgrounds: tuple[str, ...] = ()
    alike: bool = False
    rivals: float = 0.0
    tumbling: float = 0.0
    interpolate: int = 0

    def __post_init__(self) -> None:
        check_choice("layout of training data", self.layout, LAYOUTS)
        if not 0 <= self.weight < float("inf"):
            raise ArgumentError(f"weight {self.weight} of {self.path}: give 0 or more")
        if (self.layout == "stamps") != bool(self.backgrounds):
            raise ArgumentError(f"{self.path}: stamps need backgrounds, other layouts have none")
        for name in ("rivals", "tumbling"):
            if not 0 <= getattr(self, name) <= (self.layout == "stamps"):
                raise ArgumentError(
                    f"{name} {getattr(self, name)} of {self.path}: "
                    "give a fraction from 0 to 1, and only for stamps"
                )
        if not 0 <= self.interpolate <= (_MAX_GAP if self.layout == "tracks" else 0):
            raise ArgumentError(
                f"interpolate {self.interpolate} of {self.path}: "
                f"give 0 to {_MAX_GAP} frames, and only for tracks"
            )


def open_training_source(settings: SourceSettings, root: Path | None = None) -> Source:
    """Open a training set: read its annotations, but no images.

    Parameters
    ----------
    settings : SourceSettings
    root : Path, optional
        Base of relative paths; None for the working directory.

    Raises
    ------
    DatasetError
        The set is missing or damaged, or its name patterns include nothing.
    """
    with dataset_errors():
        source = _open(settings, root or Path())
    if not len(source):
        raise DatasetError(f"{settings.path}: nothing is included; check only and without")
    return source


def _open(settings: SourceSettings, root: Path) -> Source:
    path, names = root / settings.path, NameFilter(settings.only, settings.without)
    name, weight, alike = settings.name or path.stem, settings.weight, settings.alike
    if settings.layout in _READERS:
        return TrackList(name, _READERS[settings.layout](path, names), weight, alike)
    if settings.layout == "regions":
        images = images_by_stem(path)
        included = tuple(image for stem, image in images.items() if stem in names)
        return RandomPatchSource(name, included, weight, alike)
    if settings.layout == "stamps":
        objects = tuple(each for each in list_files(path, (".png",)) if each.stem in names)
        backgrounds = tuple(
            image
            for folder in settings.backgrounds
            for image in images_by_stem(root / folder).values()
        )
        fractions = settings.rivals, settings.tumbling
        return CopyPasteSource(name, objects, backgrounds, weight, alike, *fractions)
    if settings.layout == "tracks":
        return TrackFolderSource(name, path, names, weight, alike, settings.interpolate)
    dataset = open_dataset(path, settings.layout, split=settings.split)
    return SequenceSource(name, dataset, names, weight, alike)
