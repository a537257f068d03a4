"""`TrackerGroup`: several targets in one video, one estimate of the camera's motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from contextlib import suppress
from numbers import Real
from typing import Any

from ssiam.copying import NotPickled
from ssiam.errors import ArgumentError
from ssiam.geometry import Image, check_box, check_frame, four_numbers, shortened
from ssiam.motion import Motion, MotionAhead
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers.steadied import SteadiedTracker
from ssiam.trackers.track import Track


class TrackerGroup(NotPickled):
    """Follows any number of targets with trackers of one kind.

    Threads: one thread at a time for the group and its trackers; several groups may run at once.

    The camera's motion is estimated once a frame, without the points on any of the targets; the
    trackers share their networks. Copies and pickles are those of its trackers.

    Parameters
    ----------
    tracker : SteadiedTracker
        The others are made from it.

    Attributes
    ----------
    motion : Motion or None
        The camera's motion to the last frame; None with ``stabilize="off"``.
    """

    _instead = "make one in each process of a tracker loaded there"

    def __init__(self, tracker: SteadiedTracker) -> None:
        self._first = tracker.another()
        self._trackers: list[SteadiedTracker] = []
        self._boxes: Sequence[Sequence[float]] = []
        self._size_wh: tuple[int, int] | None = None
        self._camera: MotionAhead | None = None
        self.motion: Motion | None = None

    def init(self, frame: Image, boxes: Sequence[Sequence[float]]) -> None:
        """Take the targets in `boxes` (x, y, w, h) of `frame`, and no others.

        There may be none, where they `join` later. Where one of them is refused, with an error of
        `SteadiedTracker`, the group goes on with the targets that it had.
        """
        size_wh = check_frame(frame)
        trackers = []
        for box in [check_box(each, size_wh) for each in _several(boxes)]:
            tracker = self._first.another()
            tracker.init(frame, box)
            trackers.append(tracker)
        camera = self._first.camera()
        motion = None if camera is None else camera.update(frame)
        self._trackers, self._boxes, self._size_wh = trackers, list(boxes), size_wh
        self._camera, self.motion = camera, motion

    def another(self) -> SteadiedTracker:
        """A tracker of this kind without a target, to `join` once it has one."""
        return self._first.another()

    def join(self, tracker: SteadiedTracker, box: Sequence[float]) -> None:
        """Follow one more target, that `tracker` sees in `box` of the last frame.

        Raises
        ------
        ValueError
            The group has seen no frame yet, the tracker has no target, is of another
            stabilization or in the group already, or the box is not of its form.
        """
        self._check_begun()
        xywh = four_numbers(box)
        if not isinstance(tracker, SteadiedTracker) or not tracker.has_target:
            raise ArgumentError("this tracker has no target: call its init(frame, box) before join")
        if tracker.config != self._first.config:
            raise ArgumentError(
                f"this tracker stabilizes by {tracker.config.stabilize!r} or by other numbers than "
                "the group: take one from another()"
            )
        if any(each is tracker for each in self._trackers):
            raise ArgumentError("this tracker is in the group already")
        self._trackers.append(tracker)
        self._boxes = [*self._boxes, xywh]

    def leave(self, tracker: SteadiedTracker) -> None:
        """Follow the target of `tracker` no longer; `ValueError` if it is not in the group."""
        if not any(each is tracker for each in self._trackers):
            raise ArgumentError("this tracker is not in the group: it has left, or never joined")
        place = self._trackers.index(tracker)
        self._trackers = [*self._trackers[:place], *self._trackers[place + 1 :]]
        self._boxes = [*self._boxes[:place], *self._boxes[place + 1 :]]

    def switch(self, config: StabilizerConfig, frame: Image) -> None:
        """Stabilize by `config` from now on; `frame` is the last one."""
        check_frame(frame, self._size_wh)
        for tracker in (self._first, *self._trackers):
            tracker.switch(config, frame)
        self._camera = self._first.camera()
        self.motion = None if self._camera is None else self._camera.update(frame)

    def update(self, frame: Image, following: Image | None = None) -> list[Track]:
        """The targets in the next frame, in the order of their boxes; raw-frame pixels.

        `following` is the frame after this one, where it is at hand. For it and for the errors
        see `SteadiedTracker.update`.
        """
        size_wh = self._check_begun()
        check_frame(frame, size_wh)
        ahead = following is not None and check_frame(following) == size_wh
        motion = None
        if self._camera is not None:
            motion = self._camera.update(frame, exclude=self._boxes)
        self.motion = motion
        expected = [tracker.expect(motion) for tracker in self._trackers]
        known = [box for box in expected if box is not None]
        if (
            self._camera is not None
            and ahead
            and following is not None
            and len(known) == len(expected)
        ):
            self._camera.start(following, exclude=known)
        tracks = [tracker.look(frame) for tracker in self._trackers]
        self._boxes = known or [track.box for track in tracks]
        return tracks

    def _check_begun(self) -> tuple[int, int]:
        if self._size_wh is None:
            raise ArgumentError("no target yet: call init(frame, boxes) first")
        return self._size_wh


def _several(boxes: Any) -> list[Any]:
    """The boxes of a group one by one; an `ArgumentError` for what is no series of boxes."""
    several: list[Any] | None = None
    if not isinstance(boxes, str | bytes | Set | Mapping):
        with suppress(TypeError):
            several = list(boxes)
    if several is None or any(isinstance(each, Real) for each in several):
        raise ArgumentError(
            f"boxes is {shortened(boxes)}: give a list of (x, y, width, height) in pixels"
        )
    return several
