"""COCO: one JSON file of images, annotations and categories, as read by pycocotools."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ssiam.exchange.annotations import Annotation, Annotations, Corners, rounded
from ssiam.exchange.mask_shapes import mask_of
from ssiam.geometry import xywh_from_corners
from ssiam.outputs import atomic_write

_SCORE_DECIMALS = 4
_NO_SEGMENTATION: Any = []


def write_coco(annotations: Annotations, path: Path, video: str, overwrite: bool = True) -> None:
    """Write one image per frame and one annotation per visible target; raises as `write_exports`.

    Ids count from 1. The images have the names of the folder's own, or ``frame_000000.jpg`` and so
    on, from 0. A mask becomes `segmentation`, as compressed run lengths; without one, a rotated box
    becomes its polygon, and `bbox` is the upright box around it. For an upright box `segmentation`
    is empty.
    """
    tracks = annotations.tracks()
    names = {target: annotations.name(target) for target in tracks}
    categories = {name: number for number, name in enumerate(dict.fromkeys(names.values()), 1)}
    visible = [row for rows in tracks.values() for row in rows if row.visible]
    visible.sort(key=lambda row: (row.frame, row.target))
    content = {
        "info": {"description": f"{video}, tracked by ssiam", "version": "1.0"},
        "licenses": [],
        "images": [_image(annotations, frame) for frame in annotations.frames],
        "annotations": [
            _annotation(annotations, number, row, categories[names[row.target]])
            for number, row in enumerate(visible, start=1)
        ],
        "categories": [
            {"id": number, "name": name, "supercategory": ""} for name, number in categories.items()
        ],
    }
    with atomic_write(path, "w", overwrite=overwrite) as file:
        json.dump(content, file, allow_nan=False)


def _image(annotations: Annotations, frame: int) -> dict[str, Any]:
    width, height = annotations.size_wh
    name = annotations.image_name(frame)
    return {"id": frame + 1, "file_name": name, "width": width, "height": height}


def _annotation(
    annotations: Annotations, number: int, row: Annotation, category: int
) -> dict[str, Any]:
    mask = mask_of(row, annotations.size_wh)
    box, area, segmentation = row.xywh, row.xywh[2] * row.xywh[3], _NO_SEGMENTATION
    if mask is not None:
        width, height = annotations.size_wh
        area, segmentation = float(mask.sum()), {"size": [height, width], "counts": row.mask}
    elif row.corners is not None:
        box, area = xywh_from_corners(row.corners), _area(row.corners)
        segmentation = [rounded(value for point in row.corners for value in point)]
    score = round(row.score, _SCORE_DECIMALS)
    return {
        "id": number,
        "image_id": row.frame + 1,
        "category_id": category,
        "bbox": rounded(box),
        "area": round(area, 3),
        "iscrowd": 0,
        "segmentation": segmentation,
        "track_id": row.target,
        "attributes": {"score": score, "track_id": row.target, "keyframe": row.keyframe},
    }


def _area(corners: Corners) -> float:
    """Area of a polygon, by the shoelace formula."""
    following = (*corners[1:], corners[0])
    pairs = zip(corners, following, strict=True)
    return abs(sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in pairs)) / 2
