"""Label Studio: tasks with tracks for its tag VideoRectangle, written and read."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from ssiam.errors import AnnotationsError
from ssiam.exchange.annotations import (
    NO_BOX,
    Annotation,
    Annotations,
    RotatedBox,
    annotation_from_rotated_box,
    full_circle,
    rotated_box,
    rounded,
    visible_runs,
)
from ssiam.exchange.tool_files import finite, read_file, whole
from ssiam.outputs import atomic_write
from ssiam.parsing import parse_json

_PERCENT_DECIMALS = 6
_TIME_DECIMALS = 6
# A frame number is unambiguous if its time differs from the frame's own time by less than half
# the shortest gap between frames.
_NEAREST = 0.45
# Frames per second; finer time steps are of no use for stepping through frames.
_HIGHEST_FPS = 1000
_KIND: Final = "videorectangle"
_ID: Final = re.compile(r"target-([1-9][0-9]{0,2})")


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
    return {
        "id": f"target-{target}",  # `_ID`
        "type": _KIND,
        "from_name": "box",
        "to_name": "video",
        "value": _value(annotations, video_timeline, target, rows),
    }


def _value(
    annotations: Annotations, video_timeline: Timeline, target: int, rows: Sequence[Annotation]
) -> dict[str, Any]:
    duration = float(video_timeline.count / video_timeline.fps)
    return {
        "framesCount": video_timeline.count,
        "duration": round(duration, _TIME_DECIMALS),
        "labels": [annotations.name(target)],
        "sequence": list(_sequence(annotations, video_timeline, rows)),
    }


def region_value(annotations: Annotations) -> dict[str, Any]:
    """The `value` of a region for the first target, as `write_labelstudio` writes it."""
    return _value(annotations, timeline(annotations), 1, annotations.tracks().get(1, []))


def region_annotations(
    region: Mapping[str, Any], size_wh: tuple[int, int], fps: float | Fraction
) -> Annotations:
    """The annotations of one region, as target 1; frames are numbered at a constant rate.

    Raises
    ------
    AnnotationsError
        The region has no sequence, or a value that is not possible.
    """
    name, rows = _region("the region", 1, region, size_wh, {})
    return Annotations(size_wh, fps, (name,), tuple(rows.values()))


def _sequence(
    annotations: Annotations, video_timeline: Timeline, rows: Sequence[Annotation]
) -> Iterator[dict[str, Any]]:
    last = max(annotations.frames, default=-1)
    for run in visible_runs(rows, annotations.step):
        for row in run:
            enabled = row is not run[-1] or row.frame == last
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


def read_labelstudio(
    path: Path,
    size_wh: tuple[int, int],
    fps: float | Fraction,
    exported: Timeline | None = None,
) -> Annotations:
    """Read the tracks of a JSON file of Label Studio: its only task, the newest annotation.

    If nobody has annotated the task, its first prediction is read. A region is a target; targets
    are numbered from 1 in the order of the regions, or by the ids that `write_labelstudio` gives.
    After a keyframe that is not enabled, the row of the next frame is lost.

    Parameters
    ----------
    path : Path
    size_wh : (int, int)
    fps : float or Fraction
    exported : Timeline, optional
        By which frames were numbered for Label Studio; by default number 1 is frame 0, and so on.

    Raises
    ------
    AnnotationsError
        The file cannot be read, is of another kind, or has a value that is not possible.
    """
    regions = [each for each in _results(path) if each.get("type") == _KIND]
    frames = {} if exported is None else {n + 1: f for f, n in exported.numbers.items()}
    rows: dict[tuple[int, int], Annotation] = {}
    names: dict[int, str] = {}
    for target, region in _numbered(regions):
        names[target], own = _region(str(path), target, region, size_wh, frames)
        rows |= {(frame, target): row for frame, row in own.items()}
    last = max(names, default=0)
    ordered = tuple(names.get(target, f"target {target}") for target in range(1, last + 1))
    return Annotations(size_wh, fps, ordered, tuple(rows.values()))


def _region(
    file: str,
    target: int,
    region: Mapping[str, Any],
    size_wh: tuple[int, int],
    frames: dict[int, int],
) -> tuple[str, dict[int, Annotation]]:
    """Name and rows of a region, by frame; `frames` are those by number, if they differ."""
    value = region.get("value") if isinstance(region, Mapping) else None
    if not isinstance(value, dict) or not isinstance(value.get("sequence"), list):
        raise AnnotationsError(f"{file}: a region of type {_KIND} has no sequence")
    labels = value.get("labels")
    name = str(labels[0]) if isinstance(labels, list) and labels else f"target {target}"
    rows: dict[int, Annotation] = {}
    for item in value["sequence"]:
        for row in _rows(file, target, item, size_wh, frames):
            known = rows.get(row.frame)
            if known is None or not known.visible:
                rows[row.frame] = row
    return name, rows


def _results(path: Path) -> list[dict[str, Any]]:
    try:
        tasks = parse_json(read_file(path))
    except ValueError as error:
        raise AnnotationsError(f"{path}: is not JSON ({error}); is it cut off?") from None
    tasks = [tasks] if isinstance(tasks, dict) else tasks
    if not isinstance(tasks, list) or not all(isinstance(task, dict) for task in tasks):
        raise AnnotationsError(f"{path}: is not a list of tasks of Label Studio")
    if len(tasks) != 1:
        raise AnnotationsError(
            f"{path}: has {len(tasks)} tasks: export the one task of this video alone"
        )
    by_people = tasks[0].get("annotations") or []
    found = by_people[-1:] or (tasks[0].get("predictions") or [])[:1]
    if not found or not isinstance(found[0], dict) or not isinstance(found[0].get("result"), list):
        raise AnnotationsError(f"{path}: its task has no annotations: export JSON, not JSON-MIN")
    return [each for each in found[0]["result"] if isinstance(each, dict)]


def _numbered(regions: Sequence[dict[str, Any]]) -> list[tuple[int, dict[str, Any]]]:
    """Regions with the numbers of their targets: by their ids if `write_labelstudio` gave them."""
    found = [_ID.fullmatch(str(region.get("id"))) for region in regions]
    given = [int(match[1]) for match in found if match]
    if len(set(given)) == len(regions):
        return sorted(zip(given, regions, strict=True), key=lambda pair: pair[0])
    return list(enumerate(regions, 1))


def _rows(
    file: str, target: int, item: Any, size_wh: tuple[int, int], frames: dict[int, int]
) -> Iterator[Annotation]:
    if not isinstance(item, dict):
        raise AnnotationsError(f"{file}: a sequence has {item!r:.40}, not a keyframe")
    number = whole(file, "frame", item.get("frame"))
    frame = frames.get(number, number - 1) if frames else number - 1
    if frame < 0:
        raise AnnotationsError(f"{file}: frame is 0, but Label Studio counts from 1")
    x, y, w, h = (finite(file, name, item.get(name)) for name in ("x", "y", "width", "height"))
    degrees = finite(file, "rotation", item.get("rotation", 0))
    width, height = size_wh
    x, y, w, h = x * width / 100, y * height / 100, w * width / 100, h * height / 100
    if w <= 0 or h <= 0:
        raise AnnotationsError(f"{file}: frame {number}: the box {w:g}x{h:g} is empty")
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    center = x + cos * w / 2 - sin * h / 2, y + sin * w / 2 + cos * h / 2
    box = RotatedBox(*center, w, h, degrees)
    yield annotation_from_rotated_box(frame, None, target, box, keyframe=True)
    if item.get("enabled") is False:
        yield Annotation(frame + 1, None, target, NO_BOX, lost=True, keyframe=True)
