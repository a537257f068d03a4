"""Label Studio: a task with the tracks as predictions, for its tag VideoRectangle."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

from ssiam.exchange.annotations import (
    Annotation,
    Annotations,
    full_circle,
    rotated_box,
    rounded,
    visible_runs,
)
from ssiam.outputs import atomic_write

_PERCENT_DECIMALS = 6
_TIME_DECIMALS = 6
# A frame number is unambiguous if its time differs from the frame's own time by less than half
# the shortest gap between frames.
_NEAREST = 0.45
# Frames per second; finer time steps are of no use for stepping through frames.
_HIGHEST_FPS = 1000


def write_labelstudio(
    annotations: Annotations, path: Path, video: str, overwrite: bool = True
) -> None:
    """Write a list with one task; raises as `write_exports`.

    Boxes are in percent of the frame and frames count from 1. Label Studio displays a box on a
    frame whose keyframe is not `enabled`, and none after it: the last frame on which a target is
    visible is written that way, and frames on which it is lost are omitted.

    Label Studio finds a frame by its time and the frame rate of its tag Video, so frame numbers
    are the frame times at the rate of `timeline`.
    """
    video_timeline = timeline(annotations)
    results = [
        _result(annotations, video_timeline, target, rows)
        for target, rows in annotations.tracks().items()
        if any(row.visible for row in rows)
    ]
    prediction = {"model_version": "ssiam", "result": results}
    with atomic_write(path, "w", overwrite=overwrite) as file:
        json.dump([{"data": {"video": video}, "predictions": [prediction]}], file, allow_nan=False)


def _result(
    annotations: Annotations, video_timeline: Timeline, target: int, rows: Sequence[Annotation]
) -> dict[str, Any]:
    duration = float(video_timeline.count / video_timeline.fps)
    return {
        "id": f"target-{target}",
        "type": "videorectangle",
        "from_name": "box",
        "to_name": "video",
        "value": {
            "framesCount": video_timeline.count,
            "duration": round(duration, _TIME_DECIMALS),
            "labels": [annotations.name(target)],
            "sequence": list(_sequence(annotations, video_timeline, rows)),
        },
    }


def _sequence(
    annotations: Annotations, video_timeline: Timeline, rows: Sequence[Annotation]
) -> Iterator[dict[str, Any]]:
    for run in visible_runs(rows):
        for row in run:
            enabled = row is not run[-1] or row.frame + 1 == annotations.frame_count
            yield {"enabled": enabled} | _keyframe(annotations, video_timeline, row)


def _keyframe(
    annotations: Annotations, video_timeline: Timeline, row: Annotation
) -> dict[str, float | int]:
    width, height = annotations.size_wh
    box = rotated_box(row)
    # Label Studio rotates a box about its top left corner and stores that corner.
    x, y = box.rotated_xy
    shares = (x / width, y / height, box.w / width, box.h / height)
    percent = rounded((100 * share for share in shares), _PERCENT_DECIMALS)
    number = video_timeline.numbers[row.frame] + 1
    return {
        "frame": number,
        "time": round(float(number / video_timeline.fps), _TIME_DECIMALS),
        **dict(zip(("x", "y", "width", "height"), percent, strict=True)),
        "rotation": full_circle(box.degrees),
    }


@dataclass(frozen=True)
class Timeline:
    """Frame numbers at a constant frame rate, for tools that find frames by time and rate.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    fps : float or Fraction
        Frames per second: those of the video, unless its frame rate is variable.
    count : int
        Number of frames of the whole video at this rate.
    numbers : dict of int to int
        Number by frame, both from 0, for the frames that have annotations.
    """

    fps: float | Fraction
    count: int
    numbers: dict[int, int]


def timeline(annotations: Annotations) -> Timeline:
    """The timeline at a rate at which the times of the frames give each one a unique number.

    If some frames have no time, or times run backwards, the rate is taken as constant:
    ``number = frame``.
    """
    known_times = {row.frame: row.time for row in annotations.rows if row.time is not None}
    origin = known_times.get(0, 0.0)
    times = {frame: time - origin for frame, time in known_times.items()}
    frames = sorted({row.frame for row in annotations.rows})
    known = [times[frame] for frame in frames if frame in times]
    gaps = [after - before for before, after in pairwise(known)]
    starts_at_origin = bool(known) and known[0] >= 0.0
    has_times = len(known) == len(frames) and min(gaps, default=1.0) > 0 and starts_at_origin
    if not has_times or _is_constant(times, annotations.fps):
        return Timeline(annotations.fps, annotations.frame_count, {f: f for f in frames})
    fps = _fps(annotations.fps, known, min(gaps, default=1.0))
    numbers: dict[int, int] = {}
    last = -1
    for frame in frames:
        numbers[frame] = last = max(round(times[frame] * fps), last + 1)
    rest = (annotations.frame_count - frames[-1]) / annotations.fps
    count = max(numbers[frames[-1]] + 1, round((known[-1] + rest) * fps))
    return Timeline(fps, count, numbers)


def _is_constant(times: dict[int, float], fps: float | Fraction) -> bool:
    return all(abs(time * fps - frame) < 0.5 for frame, time in times.items())


def _fps(nominal: float | Fraction, times: list[float], gap: float) -> float | Fraction:
    """The first of several rates at which each time is close to a different frame number."""
    mean = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else nominal
    for fps in (nominal, Fraction(mean).limit_denominator(1001), Fraction(round(1 / gap))):
        if (
            0 < fps <= _HIGHEST_FPS
            and max(abs(t * fps - round(t * fps)) / fps for t in times) < _NEAREST * gap
        ):
            return fps
    return min(_HIGHEST_FPS, math.ceil(2 / gap))
