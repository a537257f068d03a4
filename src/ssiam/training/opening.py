"""`open_training_source`: a set of any layout, by its name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ssiam.datasets import KINDS, DatasetError, open_dataset
from ssiam.datasets.dataset import dataset_errors
from ssiam.errors import ArgumentError, check_choice
from ssiam.training.coco import read_coco
from ssiam.training.davis import read_davis
from ssiam.training.folders import by_stem, files_below
from ssiam.training.masks import read_masks
from ssiam.training.mot import read_mot
from ssiam.training.regions import RegionSource
from ssiam.training.sequences import SequenceSource
from ssiam.training.sources import Names, Source, TrackList, TrainingTrack
from ssiam.training.stamps import StampSource
from ssiam.training.track_folders import TrackFolders
from ssiam.training.voc import read_voc, read_voc_video
from ssiam.training.yolo import read_yolo
from ssiam.training.youtube_vos import read_youtube_vos

_READERS: Final[dict[str, Callable[[Path, Names], list[TrainingTrack]]]] = {
    "coco": read_coco,
    "davis": read_davis,
    "masks": read_masks,
    "mot": read_mot,
    "voc": read_voc,
    "voc_video": read_voc_video,
    "yolo": read_yolo,
    "youtube_vos": read_youtube_vos,
}
_LONGEST_GAP: Final = 1000  # frames
LAYOUTS: Final = tuple(dict.fromkeys((*_READERS, "regions", "stamps", "tracks", *KINDS)))


@dataclass(frozen=True)
class SourceSettings:
    """One set of training data.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    layout : str
        One of `LAYOUTS`: "coco", "davis", "masks", "mot", "voc", "voc_video" (pictures that follow
        each other), "yolo", "youtube_vos"; "regions" (any pictures), "stamps" (PNGs with alpha),
        "tracks" (GOT-10k's folders with a meta.json of the video they were cut out of); or a kind
        of `ssiam.datasets.open_dataset`: "got10k", "lasot", "clip", ...
    path : str
        Its folder; of "coco" the JSON file.
    weight : float
        Share of the pairs that it gives, relative to the other sets.
    name : str
        In messages; empty: the name of its folder or file.
    split : str, optional
        Of the kinds of `open_dataset` that have some.
    only, without : tuple of str
        Patterns of names of videos or pictures that are taken, or left out; of "tracks" those of
        the videos, "SET/VIDEO".
    backgrounds : tuple of str
        Of "stamps": folders of pictures to paste them on.
    alike : bool
        Two videos or pictures of it may show the very same object (a set of few scenes). Then
        what is not the target is always taken from another set.
    rivals : float
        Of "stamps": share 0..1 of the scenes in which others of about its size go beside it.
    tumbling : float
        Of "stamps": share 0..1 of the scenes in which the target shows at any angle.
    interpolate : int
        Of "tracks": frames between two annotations of another object, at most, across which its
        box is interpolated.
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
            raise ArgumentError(f"{self.path}: stamps, and only they, need backgrounds")
        for share in ("rivals", "tumbling"):
            if not 0 <= getattr(self, share) <= (self.layout == "stamps"):
                raise ArgumentError(
                    f"{share} {getattr(self, share)} of {self.path}: "
                    "give a share from 0 to 1, and to stamps only"
                )
        if not 0 <= self.interpolate <= (_LONGEST_GAP if self.layout == "tracks" else 0):
            raise ArgumentError(
                f"interpolate {self.interpolate} of {self.path}: "
                f"give 0 to {_LONGEST_GAP} frames, and to tracks only"
            )


def open_training_source(settings: SourceSettings, root: Path | None = None) -> Source:
    """The set, its annotations read, no picture opened.

    Parameters
    ----------
    settings : SourceSettings
    root : Path, optional
        What relative paths start from; None: the working directory.

    Raises
    ------
    DatasetError
        It is not there, is damaged, or nothing of it is taken.
    """
    with dataset_errors():
        source = _opened(settings, root or Path())
    if not len(source):
        raise DatasetError(f"{settings.path}: nothing of it is taken; check only and without")
    return source


def _opened(settings: SourceSettings, root: Path) -> Source:
    path, names = root / settings.path, Names(settings.only, settings.without)
    name, weight = settings.name or path.stem, settings.weight
    if settings.layout in _READERS:
        tracks = _READERS[settings.layout](path, names)
        return TrackList(name, tracks, weight, settings.alike)
    if settings.layout == "regions":
        return RegionSource(name, _named(path, names), weight, settings.alike)
    if settings.layout == "stamps":
        stamps = tuple(stamp for stamp in files_below(path, (".png",)) if stamp.stem in names)
        grounds = tuple(file for part in settings.backgrounds for file in _named(root / part))
        shares = settings.rivals, settings.tumbling
        return StampSource(name, stamps, grounds, weight, settings.alike, *shares)
    if settings.layout == "tracks":
        return TrackFolders(name, path, names, weight, settings.alike, settings.interpolate)
    dataset = open_dataset(path, settings.layout, split=settings.split)
    return SequenceSource(name, dataset, names, weight, settings.alike)


def _named(folder: Path, names: Names | None = None) -> tuple[Path, ...]:
    pictures = by_stem(folder)
    return tuple(path for stem, path in pictures.items() if names is None or stem in names)
