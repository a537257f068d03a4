"""Label Studio's brush: one task for each image, with the masks as predictions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ssiam.exchange.annotations import Annotation, Annotations
from ssiam.exchange.mask_shapes import brush_rle, mask_of
from ssiam.outputs import atomic_write


def write_brush(annotations: Annotations, path: Path, video: str, overwrite: bool = True) -> None:
    """Write a list of tasks for the tag BrushLabels; raises as `write_exports`.

    Label Studio has no brush for videos: each frame is a task, ``data.image`` the name of its
    image. Targets without a mask are omitted.
    """
    by_frame: dict[int, list[Annotation]] = {frame: [] for frame in annotations.frames}
    for rows in annotations.tracks().values():
        for row in rows:
            if row.visible:
                by_frame[row.frame].append(row)
    tasks = [
        {
            "data": {"image": annotations.image_name(frame), "video": video, "frame": frame},
            "predictions": [{"model_version": "ssiam", "result": _results(annotations, rows)}],
        }
        for frame, rows in by_frame.items()
    ]
    with atomic_write(path, "w", overwrite=overwrite) as file:
        json.dump(tasks, file, allow_nan=False)


def _results(annotations: Annotations, rows: list[Annotation]) -> list[dict[str, Any]]:
    width, height = annotations.size_wh
    found = []
    for row in rows:
        mask = mask_of(row, annotations.size_wh)
        if mask is None:
            continue
        value = {
            "format": "rle",
            "rle": brush_rle(mask),
            "brushlabels": [annotations.name(row.target)],
        }
        found.append(
            {
                "id": f"target-{row.target}",
                "type": "brushlabels",
                "from_name": "brush",
                "to_name": "image",
                "original_width": width,
                "original_height": height,
                "image_rotation": 0,
                "value": value,
            }
        )
    return found
