"""Pictures with a mask each: images/1.jpg and masks/1.png, or 1.jpg and 1.png in one folder.

Saliency sets and photographs of people come like this: one object, bright on black.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ssiam.datasets import DatasetError
from ssiam.errors import SourceError
from ssiam.training.folders import files_below, first_folder, stem_in
from ssiam.training.pictures import label_picture, size_of
from ssiam.training.skipping import Skipped
from ssiam.training.sources import Mask, Names, TrainingTrack
from ssiam.training.stills import Still

_PICTURES = ("images", "Images", "imgs", "Imgs", "Image", "photos", ".")
_MASKS = ("masks", "Masks", "mask", "Mask", "GT", ".")
# Of 255: how bright the object is at least in a grey mask, whose edge may be soft.
_BRIGHT = 128


@dataclass(frozen=True)
class MaskFile:
    """The outline that a picture of a mask tells: grey from 128 on, or a colour but black."""

    path: Path

    def mask(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) bool.

        Raises
        ------
        SourceError
            It is no image, or of another size than the picture.
        """
        labels = label_picture(self.path)
        if size_of(labels) != size_wh:
            width, height = size_of(labels)
            raise SourceError(
                f"{self.path}: has {width}x{height} pixels, its picture {size_wh[0]}x{size_wh[1]}"
            )
        return labels >= _BRIGHT


def read_masks(folder: Path, names: Names) -> list[TrainingTrack]:
    """The object of every picture as a track of one frame; `names` are those of the masks.

    Raises
    ------
    DatasetError
        A folder is missing, or more than a tenth of the masks lack their picture; the others are
        left out with a warning.
    """
    pictures, masks = first_folder(folder, _PICTURES), first_folder(folder, _MASKS)
    suffixes = (".jpg", ".jpeg") if pictures == masks else (".jpg", ".jpeg", ".png", ".bmp")
    by_name = {stem_in(pictures, path): path for path in files_below(pictures, suffixes)}
    skipped = Skipped(folder)
    tracks: list[TrainingTrack] = []
    for path in files_below(masks, (".png", ".bmp")):
        stem = stem_in(masks, path)
        if stem in names:
            with skipped.one():
                if stem not in by_name:
                    raise DatasetError(f"{path}: there is no picture {stem}")
                tracks.append(Still(by_name[stem], outline=MaskFile(path)))
    skipped.tell()
    return tracks
