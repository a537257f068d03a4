"""Readers of annotated images: PASCAL VOC, COCO, YOLO, and images with mask files.

Each reader returns one track per object. Damaged annotations are skipped, see `AnnotationErrors`.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, TypeAlias
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import DatasetError
from ssiam.datasets.files import inside, read_text
from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, iou
from ssiam.parsing import is_number_word, parse_json
from ssiam.training.data.files import (
    AnnotationErrors,
    first_folder,
    images_by_stem,
    list_files,
    relative_stem,
)
from ssiam.training.data.masks import (
    MaskImage,
    Outline,
    Polygons,
    RunLengths,
    decode_coco_counts,
)
from ssiam.training.data.tracks import BoxTrack, NameFilter, StillTrack, TrainingTrack

__all__ = ["read_coco", "read_mask_images", "read_voc", "read_voc_video", "read_yolo"]

# PASCAL VOC.
_VOC_IMAGES: Final = ("JPEGImages", "images", "Images", "imgs")
_VOC_ANNOTATIONS: Final = ("Annotations", "annotations", "annots")
_VOC_CORNERS: Final = ("xmin", "ymin", "xmax", "ymax")
_VOC_SAME_OBJECT: Final = 0.3  # IoU of an object's boxes in consecutive images of a video
_VOC_MAX_FRAMES: Final = 2000  # of a linked track

_COCO_MAX_SIDE: Final = 65536  # px of a mask
_COCO_MAX_BYTES: Final = 1 << 30  # COCO's own training annotations have half of it

# YOLO.
_YOLO_BOX, _YOLO_TRIANGLE = 4, 6  # numbers of a line: a box, or at least a triangle
_YOLO_OUTSIDE: Final = 1.0  # how far fractions may exceed 0..1, by rounding or cropped boxes

# Images with mask files.
_MASK_IMAGES: Final = ("images", "Images", "imgs", "Imgs", "Image", "photos", ".")
_MASK_FOLDERS: Final = ("masks", "Masks", "mask", "Mask", "GT", ".")

_NamedBox: TypeAlias = tuple[str, XYWH]


def read_voc(folder: Path, names: NameFilter) -> list[TrainingTrack]:
    """PASCAL VOC: JPEGImages/000001.jpg and Annotations/000001.xml.

    Integer corners are 1-based pixels that belong to the box; fractional corners, which some
    tools write, are its edges.

    Parameters
    ----------
    folder : Path
    names : NameFilter
        Matches the annotation files, without suffix.

    Raises
    ------
    DatasetError
        A folder is missing, or more than a tenth of the annotations are damaged or have no image.
    """
    annotated = _read_voc_boxes(folder, names)
    return [StillTrack(path, xywh) for path, objects in annotated for _, xywh in objects]


def read_voc_video(folder: Path, names: NameFilter) -> list[TrainingTrack]:
    """As `read_voc`, for images that are consecutive frames of videos.

    Images with a single object are linked to a track while its name stays the same and its boxes
    overlap. In images with several objects, each object is a track of one frame.
    """
    annotated = _read_voc_boxes(folder, names)
    single = [(path, objects[0]) for path, objects in annotated if len(objects) == 1]
    several = [entry for entry in annotated if len(entry[1]) > 1]
    tracks: list[TrainingTrack] = [_voc_track(run) for run in _linked(single)]
    return tracks + [StillTrack(path, xywh) for path, objects in several for _, xywh in objects]


def _read_voc_boxes(folder: Path, names: NameFilter) -> list[tuple[Path, list[_NamedBox]]]:
    annotations = first_folder(folder, _VOC_ANNOTATIONS)
    images = images_by_stem(first_folder(folder, _VOC_IMAGES))
    errors = AnnotationErrors(folder)
    found = []
    for path in list_files(annotations, (".xml",)):
        stem = relative_stem(annotations, path)
        if stem in names:
            with errors.skip():
                if stem not in images:
                    raise DatasetError(f"{path}: there is no image {stem}")
                found.append((images[stem], _voc_objects(path)))
    errors.check()
    return found


def _voc_objects(path: Path) -> list[_NamedBox]:
    text = read_text(path)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DatasetError(f"{path}: declares entities, which no annotation needs; remove it")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise DatasetError(f"{path}: is not valid XML ({error})") from None
    return [(entry.findtext("name") or "", _voc_box(entry, path)) for entry in root.iter("object")]


def _voc_box(entry: ElementTree.Element, path: Path) -> XYWH:
    try:
        words = [entry.findtext(f"bndbox/{name}") or "" for name in _VOC_CORNERS]
        left, top, right, bottom = (float(word) for word in words)
    except ValueError:
        raise DatasetError(f"{path}: has an object without the four numbers of its box") from None
    if not (right > left and bottom > top and np.isfinite((left, top, right, bottom)).all()):
        raise DatasetError(f"{path}: has a box without area, {', '.join(words)}")
    if all(is_number_word(word.strip()) for word in words):
        return left - 1, top - 1, right - left + 1, bottom - top + 1
    return left, top, right - left, bottom - top


def _linked(single: list[tuple[Path, _NamedBox]]) -> list[list[tuple[Path, _NamedBox]]]:
    """Runs of consecutive images that show the same object."""
    runs = [single[:1]]
    for (_, before), entry in pairwise(single):
        if _same_object(before, entry[1]) and len(runs[-1]) < _VOC_MAX_FRAMES:
            runs[-1].append(entry)
        else:
            runs.append([entry])
    return [run for run in runs if run]


def _same_object(before: _NamedBox, after: _NamedBox) -> bool:
    return before[0] == after[0] and float(iou(before[1], after[1])) > _VOC_SAME_OBJECT


def _voc_track(run: list[tuple[Path, _NamedBox]]) -> BoxTrack:
    paths = tuple(path for path, _ in run)
    return BoxTrack(paths[0], paths, tuple(xywh for _, (_, xywh) in run))


def read_coco(file: Path, names: NameFilter) -> list[TrainingTrack]:
    """COCO: one JSON file of images and objects with boxes and polygons or run lengths.

    The images are in a folder next to the file or next to its folder, for example train2017/
    next to annotations/instances_train2017.json. Crowds are skipped.

    Parameters
    ----------
    file : Path
    names : NameFilter
        Matches the image files.

    Raises
    ------
    DatasetError
        The file is missing or of another format, the images are missing, or more than a tenth of
        the objects are damaged.
    """
    images, objects = _coco_content(file)
    folder = _coco_image_folder(file, images)
    paths = {key: inside(folder, name, file) for key, name in images.items()}
    errors = AnnotationErrors(file)
    tracks: list[TrainingTrack] = []
    for entry in objects:
        with errors.skip():
            key = _coco_field(entry, "image_id", (int, str), file)
            if key not in paths:
                raise DatasetError(f"{file}: an object has image_id {key}, which no image has")
            if images[key] in names and not entry.get("iscrowd"):
                box, outline = _coco_box(entry, file), _coco_outline(entry, file)
                tracks.append(StillTrack(paths[key], box, outline))
    errors.check()
    return tracks


def _coco_content(file: Path) -> tuple[dict[Any, str], list[Any]]:
    """File names by image id, and the objects."""
    try:
        content = parse_json(read_text(file, _COCO_MAX_BYTES))
    except ValueError as error:
        raise DatasetError(f"{file}: is not valid JSON ({error})") from None
    if not isinstance(content, dict):
        raise DatasetError(f"{file}: holds no images and annotations in COCO's format")
    entries = _coco_field(content, "images", (list,), file)
    objects = _coco_field(content, "annotations", (list,), file)
    images = {
        _coco_field(entry, "id", (int, str), file): _coco_field(entry, "file_name", (str,), file)
        for entry in entries
    }
    if not images:
        raise DatasetError(f"{file}: lists no image")
    return images, objects


def _coco_image_folder(file: Path, images: Mapping[Any, str]) -> Path:
    """The folder that contains the first image."""
    name = next(iter(images.values()))
    split = file.stem.rpartition("_")[2]
    roots = [file.parent, file.parent.parent]
    inner = ("", "images", split, f"images/{split}", "JPEGImages", "data")
    for folder in (root / part for root in roots for part in inner):
        if inside(folder, name, file).is_file():
            return folder.resolve()
    raise DatasetError(f"{file}: the image {name!r} is neither next to it nor in {split} or images")


def _coco_field(entry: Any, name: str, kinds: tuple[type, ...], file: Path) -> Any:
    value = entry.get(name) if isinstance(entry, dict) else None
    if not isinstance(value, kinds):
        raise DatasetError(f"{file}: an entry lacks {name!r}, or has a value of another type")
    return value


def _coco_box(entry: Any, file: Path) -> XYWH:
    numbers = _coco_numbers(_coco_field(entry, "bbox", (list,), file), file)
    if numbers.shape != (4,) or not (numbers[2:] > 0).all():
        raise DatasetError(f"{file}: an object has the box {numbers.tolist()[:4]}")
    x, y, w, h = numbers.tolist()
    return x, y, w, h


def _coco_outline(entry: Any, file: Path) -> Outline | None:
    shape = entry.get("segmentation")
    if not shape:
        return None
    if isinstance(shape, list):
        rings = [_coco_numbers(ring, file) for ring in shape]
        if any(len(ring) < 6 or len(ring) % 2 for ring in rings):
            raise DatasetError(f"{file}: a polygon has an odd number of values or fewer than 6")
        return Polygons(tuple(ring.reshape(-1, 2).astype(np.float32) for ring in rings))
    counts = _coco_field(shape, "counts", (str, list), file)
    size = _coco_numbers(_coco_field(shape, "size", (list,), file), file)
    if size.shape != (2,) or not ((size >= 0) & (size < _COCO_MAX_SIDE)).all():
        raise DatasetError(f"{file}: an object has a mask of the size {str(size.tolist())[:40]}")
    height, width = size.astype(int).tolist()
    try:
        runs = (
            decode_coco_counts(counts) if isinstance(counts, str) else _coco_numbers(counts, file)
        )
        return RunLengths(runs.astype(np.int64), (width, height))
    except ArgumentError as error:
        raise DatasetError(f"{file}: {error}") from None


def _coco_numbers(values: Any, file: Path) -> NDArray[np.float64]:
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise DatasetError(f"{file}: {str(values)[:40]} are not numbers") from None
    if numbers.ndim != 1 or not np.isfinite(numbers).all():
        raise DatasetError(f"{file}: {str(values)[:40]} is not a list of finite numbers")
    return numbers


def read_yolo(folder: Path, names: NameFilter) -> list[TrainingTrack]:
    """YOLO: images/train/1.jpg and labels/train/1.txt, one object per line.

    ``class cx cy w h`` is a box, ``class x1 y1 x2 y2 ...`` a polygon, both in fractions of the
    image size. An image without a text file has no objects.

    Parameters
    ----------
    folder : Path
    names : NameFilter
        Matches the text files, without suffix: train/1.

    Raises
    ------
    DatasetError
        A folder is missing, or more than a tenth of the text files are damaged or have no image.
    """
    labels = first_folder(folder, ("labels",))
    images = images_by_stem(first_folder(folder, ("images",)))
    errors = AnnotationErrors(folder)
    tracks: list[TrainingTrack] = []
    for path in list_files(labels, (".txt",)):
        stem = relative_stem(labels, path)
        if stem in names:
            with errors.skip():
                if stem not in images:
                    raise DatasetError(f"{path}: there is no image {stem}")
                tracks += _yolo_objects(path, images[stem])
    errors.check()
    return tracks


def _yolo_objects(path: Path, image: Path) -> list[StillTrack]:
    lines = enumerate(read_text(path).splitlines(), start=1)
    return [_yolo_object(line, f"{path}: line {n}", image) for n, line in lines if line.strip()]


def _yolo_object(line: str, location: str, image: Path) -> StillTrack:
    try:
        numbers = np.array(line.split()[1:], dtype=np.float64)
    except ValueError:
        raise DatasetError(f"{location} is {line[:40]!r}, not a class and numbers") from None
    count = len(numbers)
    if count != _YOLO_BOX and (count < _YOLO_TRIANGLE or count % 2):
        raise DatasetError(f"{location} has {count} numbers, neither a box nor a polygon")
    if not (np.abs(numbers - 0.5) <= 0.5 + _YOLO_OUTSIDE).all():
        raise DatasetError(f"{location} has numbers that are not fractions of the image size")
    if count == _YOLO_BOX:
        cx, cy, w, h = numbers.tolist()
        if not (w > 0 and h > 0):
            raise DatasetError(f"{location} has a box without area")
        return StillTrack(image, (cx, cy, w, h), as_fractions=True)
    ring = numbers.reshape(-1, 2)
    low, high = ring.min(axis=0), ring.max(axis=0)
    (cx, cy), (w, h) = ((low + high) / 2).tolist(), (high - low).tolist()
    outline = Polygons((ring.astype(np.float32),), as_fractions=True)
    return StillTrack(image, (cx, cy, w, h), outline, as_fractions=True)


def read_mask_images(folder: Path, names: NameFilter) -> list[TrainingTrack]:
    """Images with one object and a mask file each: images/1.jpg and masks/1.png.

    Both may be in one folder, as 1.jpg and 1.png. Saliency and portrait datasets have this form.

    Parameters
    ----------
    folder : Path
    names : NameFilter
        Matches the mask files, without suffix.

    Raises
    ------
    DatasetError
        A folder is missing, or more than a tenth of the masks have no image.
    """
    images, masks = first_folder(folder, _MASK_IMAGES), first_folder(folder, _MASK_FOLDERS)
    suffixes = (".jpg", ".jpeg") if images == masks else (".jpg", ".jpeg", ".png", ".bmp")
    by_stem = {relative_stem(images, path): path for path in list_files(images, suffixes)}
    errors = AnnotationErrors(folder)
    tracks: list[TrainingTrack] = []
    for path in list_files(masks, (".png", ".bmp")):
        stem = relative_stem(masks, path)
        if stem in names:
            with errors.skip():
                if stem not in by_stem:
                    raise DatasetError(f"{path}: there is no image {stem}")
                tracks.append(StillTrack(by_stem[stem], outline=MaskImage(path)))
    errors.check()
    return tracks
