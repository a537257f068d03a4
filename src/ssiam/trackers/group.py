"""`TrackerGroup`: several targets in one video, one estimate of the camera's motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from contextlib import suppress
from functools import partial
from numbers import Real
from typing import Any, TypeVar

from ssiam.copying import NotPicklable
from ssiam.errors import ArgumentError, FrameSizeError
from ssiam.geometry import XYWH, Image, check_box, check_frame, short_repr, xywh_floats
from ssiam.motion import Motion, PrefetchingCameraMotion
from ssiam.stabilize import StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.steadied import SteadiedTracker

Result = TypeVar("Result")


class TrackerGroup(NotPicklable):
    """Follows any number of targets with trackers of one kind.

    Threads: one thread at a time for the group and its trackers; several groups may run at once.

    The camera's motion is estimated once a frame, without the points on any of the targets; the
    trackers share their networks. Copies and pickles are those of its trackers.

    Parameters
    ----------
    tracker : SteadiedTracker
        The others are made from it.
    keep_going : bool
        Whether `update` goes on where a tracker raises. Its target then counts as lost in this
        frame, at its last box, and is tried again in the next one; `failures` has the error. So
        does the camera's motion, which is unreliable then. A frame of another size still raises
        `FrameSizeError`.

    Attributes
    ----------
    motion : Motion or None
        The camera's motion to the last frame; None with ``stabilize="off"``.
    failures : mapping of int to Exception
        What trackers raised in the last update or switch, by the number of their box from 0;
        empty unless `keep_going`.
    camera_failure : Exception or None
        What the estimate of the camera's motion raised.
    """

    _copy_hint = "make one in each process of a tracker loaded there"

    def __init__(self, tracker: SteadiedTracker, *, keep_going: bool = False) -> None:
        self._first = tracker.another()
        self._keep_going = keep_going
        self._trackers: list[SteadiedTracker] = []
        self._boxes: Sequence[Sequence[float]] = []
        self._size_wh: tuple[int, int] | None = None
        self._camera: PrefetchingCameraMotion | None = None
        self.motion: Motion | None = None
        self.failures: Mapping[int, Exception] = {}
        self.camera_failure: Exception | None = None

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
        xywh = xywh_floats(box)
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
        """Stabilize by `config` from now on; `frame` is the last one.

        With `keep_going`, `failures` has the trackers that cannot, which should `leave`.
        """
        check_frame(frame, self._size_wh)
        failures: dict[int, Exception] = {}
        self._first.switch(config, frame)
        for place, tracker in enumerate(self._trackers):
            self._tried(failures, place, partial(tracker.switch, config, frame))
        self.failures = failures
        self._camera = self._first.camera()
        self.motion = self._moved(frame)

    def update(self, frame: Image, following: Image | None = None) -> list[Track]:
        """The targets in the next frame, in the order of their boxes; raw-frame pixels.

        `following` is the frame after this one, where it is at hand. For it and for the errors
        see `SteadiedTracker.update`.
        """
        size_wh = self._check_begun()
        check_frame(frame, size_wh)
        ahead = following is not None and check_frame(following) == size_wh
        failures: dict[int, Exception] = {}
        self.motion = motion = self._moved(frame, self._boxes)
        expected = [
            self._tried(failures, place, partial(tracker.expect, motion))
            for place, tracker in enumerate(self._trackers)
        ]
        known = [box for box in expected if box is not None]
        if (
            self._camera is not None
            and ahead
            and following is not None
            and len(known) == len(expected)
        ):
            self._camera.start(following, exclude=known)
        tracks = [
            self._tried(failures, place, partial(tracker.look, frame))
            for place, tracker in enumerate(self._trackers)
        ]
        self.failures = failures
        found = [
            self._unseen(place) if track is None or place in failures else track
            for place, track in enumerate(tracks)
        ]
        self._boxes = [
            track.box if box is None else box for box, track in zip(expected, found, strict=True)
        ]
        return found

    def _tried(
        self, failures: dict[int, Exception], place: int, work: Callable[[], Result]
    ) -> Result | None:
        """What a tracker answers; None if it has failed on this frame, which is noted."""
        if place in failures:
            return None
        try:
            return work()
        except FrameSizeError:
            raise
        except Exception as error:
            if not self._keep_going:
                raise
            failures[place] = error
            return None

    def _unseen(self, place: int) -> Track:
        """The track of a target whose tracker has failed."""
        x, y, w, h = map(float, self._boxes[place])
        box: XYWH = (x, y, w, h)
        return Track(box, score=0.0, lost=True, motion=self.motion)

    def _moved(self, frame: Image, boxes: Sequence[Sequence[float]] | None = None) -> Motion | None:
        """The camera's motion to `frame`, None with ``stabilize="off"``."""
        self.camera_failure = None
        if self._camera is None:
            return None
        try:
            return self._camera.update(frame, exclude=boxes)
        except FrameSizeError:
            raise
        except Exception as error:
            if not self._keep_going:
                raise
            self.camera_failure = error
            return Motion.none((frame.shape[1], frame.shape[0]))

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
            f"boxes is {short_repr(boxes)}: give a list of (x, y, width, height) in pixels"
        )
    return several
