"""The text formats of results: how one target in one frame becomes one line."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

from ssiam.track import Track

Value: TypeAlias = float | int | bool | None

# Decimals: a thousandth of a pixel, a microsecond, a microradian.
_PIXEL_DECIMALS, _SCORE_DECIMALS, _FINE_DECIMALS = 3, 4, 6


@dataclass(frozen=True)
class Row:
    """One target in one frame: `frame` from 0, `time` in seconds or None, `target` from 1."""

    frame: int
    time: float | None
    target: int
    track: Track


@dataclass(frozen=True)
class Layout:
    """A text format: its header line, its initial line, and the line of a `Row` (None: no line).

    `initial` stands in for the first frame of a target; `one_target` formats take a file a target.
    """

    line: Callable[[Row], str | None]
    header: str | None = None
    initial: str | None = None
    one_target: bool = False


COLUMNS = (
    *("frame", "time", "target", "x", "y", "w", "h", "score", "lost"),
    *("x1", "y1", "x2", "y2", "x3", "y3", "x4", "y4"),
    *("dx", "dy", "angle_rad", "inliers", "reliable"),
)


def record(row: Row) -> dict[str, Value]:
    """The row by `COLUMNS`: pixels, 0-based; seconds; radians. None for what there is not.

    `dx`, `dy` and `angle_rad` are the camera's motion since the frame before, taken at the
    centre of the picture; `inliers` the share of points that agree with it.
    """
    track = row.track
    corners = (None,) * 8 if track.corners is None else track.corners.ravel().tolist()
    values = (
        *(row.frame, _rounded(row.time, _FINE_DECIMALS), row.target),
        *(_rounded(value, _PIXEL_DECIMALS) for value in track.box),
        *(_rounded(track.score, _SCORE_DECIMALS), bool(track.lost)),
        *(_rounded(value, _PIXEL_DECIMALS) for value in corners),
        *_motion_values(track),
    )
    return dict(zip(COLUMNS, values, strict=True))


def csv_line(row: Row) -> str:
    """`record` separated by commas; what there is not is empty, truth values are 0 and 1."""
    return _joined(record(row).values())


def json_line(row: Row) -> str:
    """`record` as one JSON object; what there is not is null."""
    return json.dumps(record(row), allow_nan=False)


def mot_line(row: Row) -> str | None:
    """MOTChallenge: ``frame,id,x,y,w,h,conf,-1,-1,-1``; frame, id, x and y are 1-based.

    As the format has it, a lost target has no line.
    """
    if row.track.lost or not _is_finite(row.track.box):
        return None
    box = _one_based(row.track.box)
    score = _rounded(row.track.score, _SCORE_DECIMALS)
    return _joined((row.frame + 1, row.target, *box, score, -1, -1, -1))


def otb_line(row: Row) -> str:
    """OTB: ``x,y,w,h``; x and y are 1-based. A line for every frame, also of a lost target."""
    return _joined(_one_based(row.track.box) if _is_finite(row.track.box) else (0, 0, 0, 0))


def vot_line(row: Row) -> str:
    """VOT: ``x,y,w,h``, or the polygon ``x1,y1,...,x4,y4`` of a rotated box; 0-based pixels.

    A line for every frame, also of a lost target.
    """
    track = row.track
    region = track.box if track.corners is None else track.corners.ravel().tolist()
    if not _is_finite(region):
        return "0"
    return _joined(_rounded(value, _PIXEL_DECIMALS) for value in region)


LAYOUTS = {
    "csv": Layout(csv_line, header=",".join(COLUMNS)),
    "jsonl": Layout(json_line),
    "mot": Layout(mot_line),
    "otb": Layout(otb_line, one_target=True),
    "vot": Layout(vot_line, initial="1", one_target=True),
}


def _motion_values(track: Track) -> tuple[Value, ...]:
    if track.motion is None:
        return (None,) * 5
    dx, dy, angle = track.motion.shift_angle
    return (
        _rounded(dx, _PIXEL_DECIMALS),
        _rounded(dy, _PIXEL_DECIMALS),
        _rounded(angle, _FINE_DECIMALS),
        _rounded(track.motion.inliers, _SCORE_DECIMALS),
        bool(track.motion.reliable),
    )


def _one_based(xywh: Iterable[float]) -> tuple[Value, ...]:
    x, y, w, h = (_rounded(value, _PIXEL_DECIMALS) for value in xywh)
    return _rounded((x or 0) + 1, _PIXEL_DECIMALS), _rounded((y or 0) + 1, _PIXEL_DECIMALS), w, h


def _rounded(value: float | None, decimals: int) -> float | None:
    """Rounded value, never -0.0; None for what is not a number, which no format can hold."""
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), decimals) + 0.0


def _is_finite(values: Iterable[float]) -> bool:
    return all(math.isfinite(value) for value in values)


def _joined(values: Iterable[Value]) -> str:
    return ",".join(_text(value) for value in values)


def _text(value: Value) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.{_FINE_DECIMALS}f}".rstrip("0").rstrip(".")
    return str(int(value))
