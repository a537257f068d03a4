"""PASCAL VOC: JPEGImages/000001.jpg and Annotations/000001.xml, a box for every object.

Also under the names images, annots and annotations. Corners in whole numbers are 1-based pixels,
both of them inside; those with a fraction, as some tools write them, are edges.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ssiam.datasets import DatasetError
from ssiam.datasets.files import read_text
from ssiam.geometry import XYWH, iou
from ssiam.training.clips import Clip
from ssiam.training.folders import by_stem, files_below, first_folder, stem_in
from ssiam.training.skipping import Skipped
from ssiam.training.sources import Names, TrainingTrack
from ssiam.training.stills import Still

_PICTURES = ("JPEGImages", "images", "Images", "imgs")
_ANNOTATIONS = ("Annotations", "annotations", "annots")
_CORNERS = ("xmin", "ymin", "xmax", "ymax")
# Overlap of an object's boxes in a picture and the next one of the same video.
_FOLLOWS = 0.3
_LONGEST = 2000  # frames

NamedBox = tuple[str, XYWH]


def read_voc(folder: Path, names: Names) -> list[TrainingTrack]:
    """Every object of every picture as a track of one frame; `names` are those of the files.

    Raises
    ------
    DatasetError
        A folder is missing, or more than a tenth of the annotations are damaged or lack their
        picture; the others are left out with a warning.
    """
    annotated = _read_all(folder, names)
    return [Still(path, xywh) for path, objects in annotated for _, xywh in objects]


def read_voc_video(folder: Path, names: Names) -> list[TrainingTrack]:
    """As `read_voc`, of pictures that follow each other as frames of a video.

    An object that is alone in its pictures, of one name, and whose boxes overlap from one to the
    next is one track; objects in company are tracks of one frame.
    """
    annotated = _read_all(folder, names)
    alone = [(path, objects[0]) for path, objects in annotated if len(objects) == 1]
    others = [entry for entry in annotated if len(entry[1]) > 1]
    tracks: list[TrainingTrack] = [_clip(run) for run in _runs(alone)]
    return tracks + [Still(path, xywh) for path, objects in others for _, xywh in objects]


def _read_all(folder: Path, names: Names) -> list[tuple[Path, list[NamedBox]]]:
    texts = first_folder(folder, _ANNOTATIONS)
    pictures = by_stem(first_folder(folder, _PICTURES))
    skipped = Skipped(folder)
    found = []
    for path in files_below(texts, (".xml",)):
        stem = stem_in(texts, path)
        if stem in names:
            with skipped.one():
                if stem not in pictures:
                    raise DatasetError(f"{path}: there is no picture {stem}")
                found.append((pictures[stem], _objects(path)))
    skipped.tell()
    return found


def _objects(path: Path) -> list[NamedBox]:
    text = read_text(path)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DatasetError(f"{path}: declares entities, which no annotation needs; remove it")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise DatasetError(f"{path}: is no XML ({error})") from None
    return [(_text(entry, "name"), _box(entry, path)) for entry in root.iter("object")]


def _box(entry: ElementTree.Element, path: Path) -> XYWH:
    try:
        words = [_text(entry, f"bndbox/{name}") for name in _CORNERS]
        left, top, right, bottom = (float(word) for word in words)
    except ValueError:
        raise DatasetError(f"{path}: has an object without the four numbers of its box") from None
    if not (right > left and bottom > top and np.isfinite((left, top, right, bottom)).all()):
        raise DatasetError(f"{path}: has a box without area, {', '.join(words)}")
    if all(word.strip().isdigit() for word in words):
        return left - 1, top - 1, right - left + 1, bottom - top + 1
    return left, top, right - left, bottom - top


def _text(entry: ElementTree.Element, name: str) -> str:
    return entry.findtext(name) or ""


def _runs(alone: list[tuple[Path, NamedBox]]) -> list[list[tuple[Path, NamedBox]]]:
    runs = [alone[:1]]
    for (_, before), entry in pairwise(alone):
        if _follows(before, entry[1]) and len(runs[-1]) < _LONGEST:
            runs[-1].append(entry)
        else:
            runs.append([entry])
    return [run for run in runs if run]


def _follows(before: NamedBox, after: NamedBox) -> bool:
    return before[0] == after[0] and float(iou(before[1], after[1])) > _FOLLOWS


def _clip(run: list[tuple[Path, NamedBox]]) -> Clip:
    paths = tuple(path for path, _ in run)
    return Clip(paths[0], paths, tuple(xywh for _, (_, xywh) in run))
