"""`Annotations`: where the targets of one video are, for programs that know nothing of `Track`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Final, TypeAlias

from ssiam.errors import AnnotationsError, ArgumentError
from ssiam.exchange.result_lines import Record, read_records
from ssiam.geometry import XYWH
from ssiam.track import Track

Corners: TypeAlias = tuple[tuple[float, float], ...]

# Exports hold a line a frame, whatever the results say of it.
_LAST_FRAME: Final = 999_999
_LAST_TARGET: Final = 1000
_NO_BOX: Final = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Annotation:
    """One target in one frame; pixels of the raw frame, 0-based.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    frame : int
        From 0.
    time : float or None
        Seconds; None where the source told no times.
    target : int
        From 1.
    xywh : (x, y, w, h) floats
        Upright box; without area where there is none.
    corners : four (x, y), or None
        Rotated box of the mask trackers, in order around it.
    score : float
    lost : bool
        The box is a guess, not to be shown.
    """

    frame: int
    time: float | None
    target: int
    xywh: XYWH
    corners: Corners | None = None
    score: float = 1.0
    lost: bool = False

    @property
    def seen(self) -> bool:
        """Whether there is a box to show."""
        return not self.lost and self.xywh[2] > 0 and self.xywh[3] > 0


@dataclass(frozen=True)
class Annotations:
    """All targets of one video.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.
    fps : float or Fraction
        Frames a second.
    names : tuple of str
        ``names[target - 1]``; several targets may share one, the name of their kind.
    rows : tuple of Annotation
        In any order, each target at most once a frame; frames may be left out.
    length : int
        Number of frames of the video, where more is known of it than what `rows` tell.

    Raises
    ------
    ArgumentError
        On construction: an impossible size or rate, or a target that has no name.
    """

    size_wh: tuple[int, int]
    fps: float | Fraction
    names: tuple[str, ...]
    rows: tuple[Annotation, ...]
    length: int = 0

    def __post_init__(self) -> None:
        if min(self.size_wh) < 1:
            raise ArgumentError(f"size {self.size_wh} is no size of frames: give width and height")
        if not 0 < self.fps < math.inf:
            raise ArgumentError(
                f"frame rate {self.fps} is not a positive number of frames a second"
            )
        most = max((row.target for row in self.rows), default=0)
        if most > len(self.names):
            raise ArgumentError(f"{len(self.names)} names for {most} targets: give each one a name")

    @cached_property
    def frame_count(self) -> int:
        """Number of frames of the video, as far as it is known."""
        return max(self.length, 1 + max((row.frame for row in self.rows), default=-1))

    def name(self, target: int) -> str:
        """The target's name, without unprintable characters, which some formats cannot hold."""
        shown = "".join(c if c.isprintable() else "\ufffd" for c in self.names[target - 1])
        return shown or f"target {target}"

    def tracks(self) -> dict[int, list[Annotation]]:
        """Rows by target, in the order of targets and frames."""
        found: dict[int, list[Annotation]] = {}
        for row in sorted(self.rows, key=lambda row: (row.target, row.frame)):
            found.setdefault(row.target, []).append(row)
        return found


def annotation_of(frame_index: int, time: float | None, target: int, track: Track) -> Annotation:
    """What `track` says of a target (from 1) in a frame (from 0) at `time` seconds.

    A box that is not finite is none, and its target lost.
    """
    finite = all(map(math.isfinite, track.box))
    corners = None
    if track.corners is not None and all(map(math.isfinite, track.corners.ravel())):
        corners = tuple((float(x), float(y)) for x, y in track.corners)
    x, y, w, h = map(float, track.box if finite else _NO_BOX)
    score = float(track.score) if math.isfinite(track.score) else 0.0
    lost = bool(track.lost) or not finite
    return Annotation(frame_index, time, target, (x, y, w, h), corners, score, lost)


def read_annotations(
    path: str | Path,
    size_wh: tuple[int, int],
    fps: float | Fraction,
    names: Sequence[str] | None = None,
) -> Annotations:
    """The annotations in a .csv or .jsonl that ``ssiam track --results`` wrote.

    Parameters
    ----------
    path : str or Path
        Not trusted: its lines are limited in length and number, and each is checked.
    size_wh : (int, int)
        Width and height of the video's frames, pixels.
    fps : float or Fraction
        Frames a second.
    names : sequence of str, optional
        One a target; "target 1", "target 2", ... unless given.

    Raises
    ------
    AnnotationsError
        The file is missing, damaged, or of another kind; one line with file and line number.
    ArgumentError
        `names` are not as many as there are targets, or `size_wh` or `fps` is impossible.
    """
    rows: dict[tuple[int, int], Annotation] = {}
    for number, record in read_records(Path(path)):
        try:
            row = _annotation(record)
        except ValueError as error:
            raise AnnotationsError(f"{path}: line {number}: {error}") from None
        if rows.setdefault((row.frame, row.target), row) is not row:
            raise AnnotationsError(
                f"{path}: line {number}: target {row.target} is in frame {row.frame} a second time"
            )
    most = max((target for _, target in rows), default=0)
    if names is not None and len(names) != most:
        raise ArgumentError(f"{len(names)} names for the {most} targets of {path}: give one each")
    named = [f"target {i}" for i in range(1, most + 1)] if names is None else names
    return Annotations(size_wh, fps, tuple(named), tuple(rows.values()))


def _annotation(record: Record) -> Annotation:
    """The annotation of a line; `ValueError` that says what is wrong with it."""
    x, y, w, h = (record[name] for name in "xywh")
    points = [record[f"{axis}{number}"] for number in "1234" for axis in "xy"]
    known = [value for value in points if value is not None]
    has_box = x is not None and y is not None and w is not None and h is not None
    return Annotation(
        _whole(record, "frame", 0, _LAST_FRAME),
        record["time"],
        _whole(record, "target", 1, _LAST_TARGET),
        (x, y, w, h) if has_box else _NO_BOX,  # type: ignore[arg-type]
        tuple(zip(known[::2], known[1::2], strict=True)) if len(known) == len(points) else None,
        record["score"] or 0.0,
        bool(_whole(record, "lost", 0, 1)) or not has_box,
    )


def _whole(record: Record, name: str, lowest: int, highest: int) -> int:
    value = record[name]
    if value is None or not value.is_integer() or not lowest <= value <= highest:
        shown = "missing" if value is None else f"{value:g}"
        raise ValueError(f"{name} is {shown}, not a whole number from {lowest} to {highest}")
    return int(value)
