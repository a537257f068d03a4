"""`Annotations`: the targets of one video, independent of `Track`, for export to other tools."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Final, TypeAlias

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, xywh_from_corners
from ssiam.track import Track

Corners: TypeAlias = tuple[tuple[float, float], ...]

NO_BOX: Final = (0.0, 0.0, 0.0, 0.0)

_DECIMALS: Final = 3  # of pixels and degrees


@dataclass(frozen=True)
class Annotation:
    """One target in one frame; pixels of the raw frame, 0-based.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    frame : int
        From 0.
    time : float or None
        Seconds; None if the source has no timestamps.
    target : int
        From 1.
    xywh : (x, y, w, h) floats
        Upright box; zero size if there is none.
    corners : four (x, y), or None
        Rotated box of a mask tracker, in order around it.
    score : float
    lost : bool
        The target is lost; the box is a guess and not to be displayed.
    keyframe : bool
        Given by a person, box or absence; else tracked.
    mask : str or None
        The target's pixels in the whole frame, as `ssiam.video.mask_codec` encodes them.
    """

    frame: int
    time: float | None
    target: int
    xywh: XYWH
    corners: Corners | None = None
    score: float = 1.0
    lost: bool = False
    keyframe: bool = False
    mask: str | None = None

    @property
    def visible(self) -> bool:
        """Whether there is a box to display."""
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
        Frames per second.
    names : tuple of str
        ``names[target - 1]``; targets of the same class may share a name.
    rows : tuple of Annotation
        In any order, each target at most once per frame; frames may be missing.
    length : int
        Number of frames of the video, if it is larger than the last frame of `rows` implies.
    start, step : int
        The annotated frames are `start`, ``start + step``, ... of the video.
    image_names : tuple of str
        Name of the image of each frame of the video, for folders of images; may be empty.

    Raises
    ------
    ArgumentError
        On construction: an impossible size or rate, or a target without a name.
    """

    size_wh: tuple[int, int]
    fps: float | Fraction
    names: tuple[str, ...]
    rows: tuple[Annotation, ...]
    length: int = 0
    start: int = 0
    step: int = 1
    image_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if min(self.size_wh) < 1:
            raise ArgumentError(f"frame size {self.size_wh} is not positive: give width and height")
        if not 0 < self.fps < math.inf:
            raise ArgumentError(
                f"frame rate {self.fps} is not a positive number of frames per second"
            )
        if self.start < 0 or self.step < 1:
            raise ArgumentError(
                f"frames from {self.start} in steps of {self.step} are not possible: give a start "
                "of at least 0 and a step of at least 1"
            )
        targets = max((row.target for row in self.rows), default=0)
        if targets > len(self.names):
            raise ArgumentError(
                f"{len(self.names)} names for {targets} targets: give each one a name"
            )

    @cached_property
    def frame_count(self) -> int:
        """Number of frames of the video, as far as it is known."""
        return max(self.length, 1 + max((row.frame for row in self.rows), default=-1))

    @property
    def frames(self) -> range:
        """The annotated frames of the video."""
        return range(self.start, self.frame_count, self.step)

    def every(self, start: int, step: int) -> Annotations:
        """The annotations of frames `start`, ``start + step``, ... alone."""
        kept = tuple(
            row for row in self.rows if row.frame >= start and (row.frame - start) % step == 0
        )
        return replace(self, rows=kept, start=start, step=step, length=self.frame_count)

    def image_name(self, frame: int) -> str:
        """The name of a frame's image; ``frame_000000.jpg`` and so on for videos."""
        if frame < len(self.image_names):
            return self.image_names[frame]
        return f"frame_{frame:06d}.jpg"

    def name(self, target: int) -> str:
        """The target's name, without unprintable characters, which some formats cannot hold."""
        return printable(self.names[target - 1]) or f"target {target}"

    def tracks(self) -> dict[int, list[Annotation]]:
        """Rows by target, sorted by target and frame."""
        found: dict[int, list[Annotation]] = {}
        for row in sorted(self.rows, key=lambda row: (row.target, row.frame)):
            found.setdefault(row.target, []).append(row)
        return found


def printable(text: str) -> str:
    """The text with replaced control characters and bytes that are no characters.

    XML and JSON files cannot hold them; names of files can.
    """
    return "".join(each if each.isprintable() else "\ufffd" for each in text)


def annotation_from_track(
    frame_index: int, time: float | None, target: int, track: Track
) -> Annotation:
    """The annotation of target number `target` (from 1) in a frame (from 0) at `time` seconds.

    A box that is not finite counts as lost, without a box. The mask is left out.
    """
    is_finite = all(map(math.isfinite, track.box))
    corners = None
    if track.corners is not None and all(map(math.isfinite, track.corners.ravel())):
        corners = tuple((float(x), float(y)) for x, y in track.corners)
    x, y, w, h = map(float, track.box if is_finite else NO_BOX)
    score = float(track.score) if math.isfinite(track.score) else 0.0
    lost = bool(track.lost) or not is_finite
    return Annotation(frame_index, time, target, (x, y, w, h), corners, score, lost, track.keyframe)


def visible_runs(rows: Sequence[Annotation], step: int = 1) -> Iterator[list[Annotation]]:
    """Runs of frames, `step` apart, in which one target is visible; `rows` are sorted by frame."""
    run: list[Annotation] = []
    for row in rows:
        if run and (not row.visible or row.frame != run[-1].frame + step):
            yield run
            run = []
        if row.visible:
            run.append(row)
    if run:
        yield run


@dataclass(frozen=True)
class RotatedBox:
    """A box of width `w` and height `h` (pixels), rotated about its center.

    `degrees` are clockwise on screen, -45 to 45.
    """

    cx: float
    cy: float
    w: float
    h: float
    degrees: float

    @property
    def upright_xy(self) -> tuple[float, float]:
        """Top left corner of the box before rotation."""
        return self.cx - self.w / 2, self.cy - self.h / 2

    @property
    def rotated_xy(self) -> tuple[float, float]:
        """The same corner after rotation."""
        cos, sin = math.cos(math.radians(self.degrees)), math.sin(math.radians(self.degrees))
        x, y = -self.w / 2, -self.h / 2
        return self.cx + cos * x - sin * y, self.cy + sin * x + cos * y


def rotated_box(annotation: Annotation) -> RotatedBox:
    """The target's rotated box, or its upright one with an angle of 0."""
    if annotation.corners is not None:
        return _box_from_corners(annotation.corners)
    x, y, w, h = annotation.xywh
    return RotatedBox(x + w / 2, y + h / 2, w, h, 0.0)


def _box_from_corners(corners: Corners) -> RotatedBox:
    """The box of four corners in order around it; opposite sides are averaged."""
    (x1, y1), (x2, y2), (x3, y3), (x4, y4) = corners
    along = ((x2 - x1 + x3 - x4) / 2, (y2 - y1 + y3 - y4) / 2)
    across = ((x4 - x1 + x3 - x2) / 2, (y4 - y1 + y3 - y2) / 2)
    w, h = math.hypot(*along), math.hypot(*across)
    degrees = math.degrees(math.atan2(along[1], along[0]))
    # Four angles describe the same box; annotators would use the smallest.
    quarters = math.floor(degrees / 90 + 0.5)
    if quarters % 2:
        w, h = h, w
    center = (x1 + x2 + x3 + x4) / 4, (y1 + y2 + y3 + y4) / 4
    return RotatedBox(*center, w, h, degrees - 90 * quarters)


def rounded(values: Iterable[float], decimals: int = _DECIMALS) -> list[float]:
    """The values rounded, never -0.0."""
    return [round(value, decimals) + 0.0 for value in values]


def full_circle(degrees: float) -> float:
    """Rounded degrees in the range 0 to below 360."""
    return round(degrees, _DECIMALS) % 360


def corners_of_rotated_box(box: RotatedBox) -> Corners:
    """The corners of a rotated box, in order around it from its rotated top left one."""
    cos, sin = math.cos(math.radians(box.degrees)), math.sin(math.radians(box.degrees))
    w, h = box.w / 2, box.h / 2
    return tuple(
        (box.cx + cos * x - sin * y, box.cy + sin * x + cos * y)
        for x, y in ((-w, -h), (w, -h), (w, h), (-w, h))
    )


def annotation_from_rotated_box(
    frame: int,
    time: float | None,
    target: int,
    box: RotatedBox,
    *,
    lost: bool = False,
    keyframe: bool = False,
) -> Annotation:
    """The annotation of a box as annotation tools store it; upright at an angle of 0."""
    if box.degrees == 0:
        xywh = (box.cx - box.w / 2, box.cy - box.h / 2, box.w, box.h)
        return Annotation(frame, time, target, xywh, lost=lost, keyframe=keyframe)
    corners = corners_of_rotated_box(box)
    return Annotation(
        frame, time, target, xywh_from_corners(corners), corners, lost=lost, keyframe=keyframe
    )
