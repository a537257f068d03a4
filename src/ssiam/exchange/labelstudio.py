"""Label Studio: a task with the tracks as predictions, for its tag VideoRectangle."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ssiam.exchange.annotations import Annotation, Annotations
from ssiam.exchange.appearances import appearances
from ssiam.exchange.boxes import full_circle, rounded, turned_box
from ssiam.exchange.timeline import Timeline, timeline
from ssiam.outputs import atomic_write

_PERCENT_DECIMALS = 6
_TIME_DECIMALS = 6


def write_labelstudio(
    annotations: Annotations, path: Path, video: str, overwrite: bool = True
) -> None:
    """Write the list of one task; errors as `write_exports`.

    Boxes are in percent of the frame and frames count from 1. Label Studio still shows a box on
    a frame that is not `enabled`, and none after it: the last frame on which a target is seen is
    the one that is not, and frames on which it is lost are left out.

    Label Studio finds a frame by its time and the frame rate of its tag Video, so that numbers
    are those of the frames' own times at the rate of `timeline`.
    """
    line = timeline(annotations)
    results = [
        _result(annotations, line, target, rows)
        for target, rows in annotations.tracks().items()
        if any(row.seen for row in rows)
    ]
    prediction = {"model_version": "ssiam", "result": results}
    with atomic_write(path, "w", overwrite=overwrite) as file:
        json.dump([{"data": {"video": video}, "predictions": [prediction]}], file, allow_nan=False)


def _result(
    annotations: Annotations, line: Timeline, target: int, rows: Sequence[Annotation]
) -> dict[str, Any]:
    duration = float(line.count / line.fps)
    return {
        "id": f"target-{target}",
        "type": "videorectangle",
        "from_name": "box",
        "to_name": "video",
        "value": {
            "framesCount": line.count,
            "duration": round(duration, _TIME_DECIMALS),
            "labels": [annotations.name(target)],
            "sequence": list(_sequence(annotations, line, rows)),
        },
    }


def _sequence(
    annotations: Annotations, line: Timeline, rows: Sequence[Annotation]
) -> Iterator[dict[str, Any]]:
    for run in appearances(rows):
        for row in run:
            goes_on = row is not run[-1] or row.frame + 1 == annotations.frame_count
            yield {"enabled": goes_on} | _keyframe(annotations, line, row)


def _keyframe(annotations: Annotations, line: Timeline, row: Annotation) -> dict[str, float | int]:
    width, height = annotations.size_wh
    box = turned_box(row)
    # The box is turned about its top left corner, which is told where it lies afterwards.
    x, y = box.turned_xy
    shares = (x / width, y / height, box.w / width, box.h / height)
    percent = rounded((100 * share for share in shares), _PERCENT_DECIMALS)
    number = line.numbers[row.frame] + 1
    return {
        "frame": number,
        "time": round(float(number / line.fps), _TIME_DECIMALS),
        **dict(zip(("x", "y", "width", "height"), percent, strict=True)),
        "rotation": full_circle(box.degrees),
    }
