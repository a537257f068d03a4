"""YOLO: a zip with data.yaml and one text file of labels for each image."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

from ssiam.exchange.annotations import Annotation, Annotations
from ssiam.exchange.mask_shapes import mask_of, polygon
from ssiam.exchange.zip_entries import add_text
from ssiam.outputs import atomic_write

_DECIMALS = 6
_IMAGES, _LABELS = "images", "labels"


def write_yolo(annotations: Annotations, path: Path, video: str, overwrite: bool = True) -> None:
    """Write the zip; raises as `write_exports`.

    A line is ``class x y width height``, with the center of the box, in shares of the frame; boxes
    are cut at the frame's edges. If the results hold masks, lines are those of segmentation
    instead: ``class x1 y1 x2 y2 ...``, the outline of the mask. Images without a visible target
    have an empty file. data.yaml names the folder `images`, where the images belong.
    """
    tracks = annotations.tracks()
    names = {target: annotations.name(target) for target in tracks}
    classes = {name: number for number, name in enumerate(dict.fromkeys(names.values()))}
    has_masks = any(row.mask is not None for row in annotations.rows)
    lines: dict[int, list[str]] = {frame: [] for frame in annotations.frames}
    for target, rows in tracks.items():
        for row in rows:
            shape = _shape(annotations, row, has_masks=has_masks) if row.visible else []
            if shape:
                lines[row.frame].append(" ".join([str(classes[names[target]]), *shape]))
    with (
        atomic_write(path, "wb", overwrite=overwrite) as file,
        ZipFile(file, "w", ZIP_DEFLATED) as archive,
    ):
        add_text(archive, "data.yaml", list(_data_yaml(classes, video)))
        for frame, found in lines.items():
            name = Path(annotations.image_name(frame)).stem
            add_text(archive, f"{_LABELS}/{name}.txt", found)


def _data_yaml(classes: dict[str, int], video: str) -> Iterator[str]:
    yield f"# {json.dumps(video)}, tracked by ssiam"
    yield f"train: {_IMAGES}"
    yield f"val: {_IMAGES}"
    yield "names:"
    for name, number in classes.items():
        yield f"  {number}: {json.dumps(name)}"  # a JSON string is one of YAML


def _shape(annotations: Annotations, row: Annotation, *, has_masks: bool) -> list[str]:
    """The numbers of a line; none if the target is outside of the frame."""
    width, height = annotations.size_wh
    x, y, w, h = row.xywh
    left, right = max(x, 0.0), min(x + w, float(width))
    top, bottom = max(y, 0.0), min(y + h, float(height))
    if right <= left or bottom <= top:
        return []
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    if has_masks:
        mask = mask_of(row, annotations.size_wh)
        points = (None if mask is None else polygon(mask)) or corners
        shares = [share for px, py in points for share in (px / width, py / height)]
    else:
        center = (left + right) / 2 / width, (top + bottom) / 2 / height
        shares = [*center, (right - left) / width, (bottom - top) / height]
    return [f"{share:.{_DECIMALS}f}" for share in shares]
