"""`Targets`: those of a live session, which come and go."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.motion import Motion
from ssiam.stabilize import StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker, TrackerGroup
from ssiam.video import COLORS, Frame
from ssiam.web.errors import CommandError
from ssiam.web.step import Target

_NAME_LENGTH = 40


@dataclass
class _Followed:
    """A target, how it began, and where it was last; `tracker` is None until it begins."""

    id: int
    name: str
    colour: str
    index: int  # of the frame in which it was drawn
    xywh: XYWH
    tracker: StabilizedTracker | None = None
    track: Track | None = None
    found: bool = False
    error: str = ""


class Targets:
    """Follows targets on the frames of a session, and keeps their names.

    A tracker that raises is tried again on the next frame, its target counts as lost in this one;
    a target that cannot begin, or not go on, is removed. Neither concerns the other targets.

    Parameters
    ----------
    tracker : StabilizedTracker
        The targets' trackers are made from it.
    most : int
        How many targets there may be.
    failed : callable
        Told what went wrong, and the error; returns that as one line.
    """

    def __init__(
        self, tracker: StabilizedTracker, most: int, failed: Callable[[str, Exception], str]
    ) -> None:
        self._group = TrackerGroup(tracker, keep_going=True)
        self._failed = failed
        self._config = tracker.config
        self._most = most
        self._followed: list[_Followed] = []
        self._given = 0

    def __len__(self) -> int:
        return len(self._followed)

    @property
    def config(self) -> StabilizerConfig:
        """How the frames are steadied."""
        return self._config

    @property
    def motion(self) -> Motion | None:
        """The camera's motion to the last frame."""
        return self._group.motion

    def begin(self, frame: Frame) -> None:
        """Take the first frame of a source; the targets begin where they were drawn."""
        self._group.init(frame.image, [])
        for each in self._followed:
            each.tracker = each.track = None
            each.found, each.error = False, ""
        self._report_camera()
        self._begin_waiting(frame)

    def update(self, frame: Frame) -> None:
        """Find all targets in the next frame."""
        running = [each for each in self._followed if each.tracker is not None]
        tracks = self._group.update(frame.image)
        for place, (each, track) in enumerate(zip(running, tracks, strict=True)):
            error = self._group.failures.get(place)
            # A frame on which the tracker failed neither loses the target nor finds it again.
            was_lost = each.track is not None and each.track.lost and not each.error
            each.found = was_lost and not track.lost
            each.track = track
            each.error = "" if error is None else self._failed(f"the tracker of {each.name}", error)
        self._report_camera()
        self._begin_waiting(frame)

    def add(self, frames: Sequence[Frame], xywh: XYWH, name: str | None) -> int:
        """Follow what is in `xywh` of the first of `frames`, the last ones; its id.

        Raises
        ------
        CommandError
            There are too many targets, or no target can be in that box, or the name is too long.
        """
        if len(self._followed) >= self._most:
            raise CommandError("too-many-targets", f"{self._most} targets are followed already")
        name = _checked(name or f"target {self._given + 1}")
        tracker = self._group.new_tracker()
        try:
            tracker.init(frames[0].image, xywh)
        except ArgumentError as error:
            raise CommandError("bad-box", str(error)) from error
        track = Track(xywh)
        for frame in frames[1:]:
            track = tracker.update(frame.image)
        id = self._given + 1
        colour = _hex(COLORS[(id - 1) % len(COLORS)])
        followed = _Followed(id, name, colour, frames[0].index, xywh, tracker, track)
        self._group.join(tracker, track.box)
        self._followed.append(followed)
        self._given = id
        return id

    def remove(self, id: int | None) -> None:
        """Follow a target no longer, or none of them."""
        gone = self._followed if id is None else [self._one(id)]
        for each in gone:
            if each.tracker is not None:
                self._group.leave(each.tracker)
        self._followed = [each for each in self._followed if each not in gone]

    def rename(self, id: int, name: str) -> None:
        """Call a target by another name."""
        self._one(id).name = _checked(name)

    def steady(self, config: StabilizerConfig, frame: Frame | None) -> None:
        """Steady by `config` from now on; `frame` is the last one.

        Targets whose trackers cannot be switched are removed.
        """
        if frame is None:
            raise CommandError("not-possible", "no frame has come yet: try again when one has")
        self._config = config
        running = [each for each in self._followed if each.tracker is not None]
        self._group.switch(config, frame.image)
        for place, error in self._group.failures.items():
            what = f"is removed, for it cannot go on with {config.stabilize}"
            self._give_up(running[place], what, error)
        self._report_camera()

    def seen(self) -> tuple[Target, ...]:
        """All targets that have begun, as they are now."""
        return tuple(
            Target(each.id, each.name, each.colour, each.track, each.found, each.error)
            for each in self._followed
            if each.track is not None
        )

    def _begin_waiting(self, frame: Frame) -> None:
        """Begin the targets that were drawn in this frame, or in one that was left out."""
        for each in list(self._followed):
            if each.tracker is not None or frame.index < each.index:
                continue
            tracker = self._group.new_tracker()
            try:
                tracker.init(frame.image, each.xywh)
            except Exception as error:
                self._give_up(each, "is removed, for it cannot begin in these frames", error)
                continue
            each.tracker, each.track = tracker, Track(each.xywh)
            self._group.join(tracker, each.xywh)

    def _give_up(self, target: _Followed, what: str, error: Exception) -> None:
        """Follow a target no longer, because of an error."""
        self._failed(f"{target.name} {what}", error)
        self.remove(target.id)

    def _report_camera(self) -> None:
        if self._group.camera_failure is not None:
            self._failed("the camera's motion in this frame", self._group.camera_failure)

    def _one(self, id: int) -> _Followed:
        for each in self._followed:
            if each.id == id:
                return each
        raise CommandError("no-such-target", f"there is no target {id}")


def _checked(name: str) -> str:
    plain = " ".join(name.split())
    if not 0 < len(plain) <= _NAME_LENGTH or not plain.isprintable():
        raise CommandError("not-possible", f"a name has 1 to {_NAME_LENGTH} printable characters")
    return plain


def _hex(bgr: Sequence[float]) -> str:
    return "#" + "".join(f"{math.floor(value):02x}" for value in reversed(bgr))
