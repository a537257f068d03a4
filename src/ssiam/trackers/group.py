"""`TrackerGroup`: several targets in one video, one estimate of the camera's motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TypeVar

from ssiam.errors import FrameSizeError
from ssiam.geometry import XYWH, Image
from ssiam.motion import Motion, MotionAhead
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers.steadied import SteadiedTracker
from ssiam.trackers.track import Track

Result = TypeVar("Result")


class TrackerGroup:
    """Follows any number of targets with trackers of one kind.

    The camera's motion is estimated once a frame, without the points on any of the targets; the
    trackers share their networks.

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

    def __init__(self, tracker: SteadiedTracker, *, keep_going: bool = False) -> None:
        self._first = tracker
        self._keep_going = keep_going
        self._trackers: list[SteadiedTracker] = []
        self._boxes: Sequence[Sequence[float]] = []
        self._camera: MotionAhead | None = None
        self.motion: Motion | None = None
        self.failures: Mapping[int, Exception] = {}
        self.camera_failure: Exception | None = None

    def init(self, frame: Image, boxes: Sequence[Sequence[float]]) -> None:
        """Take the targets in `boxes` (x, y, w, h) of `frame`; errors as `SteadiedTracker`."""
        others = [self._first.another() for _ in boxes[1:]]
        self._trackers = [self._first, *others][: len(boxes)]
        for tracker, box in zip(self._trackers, boxes, strict=True):
            tracker.init(frame, box)
        self._boxes = list(boxes)
        self._watch_from(frame)

    def another(self) -> SteadiedTracker:
        """A tracker of this kind without a target, to `join` once it has one."""
        return self._first.another()

    def join(self, tracker: SteadiedTracker, box: Sequence[float]) -> None:
        """Follow one more target, that `tracker` sees in `box` of the last frame."""
        self._trackers.append(tracker)
        self._boxes = [*self._boxes, box]

    def leave(self, tracker: SteadiedTracker) -> None:
        """Follow the target of `tracker` no longer."""
        place = self._trackers.index(tracker)
        self._trackers = [*self._trackers[:place], *self._trackers[place + 1 :]]
        self._boxes = [*self._boxes[:place], *self._boxes[place + 1 :]]

    def switch(self, config: StabilizerConfig, frame: Image) -> None:
        """Steady by `config` from now on; `frame` is the last one.

        With `keep_going`, `failures` has the trackers that cannot, which should `leave`.
        """
        failures: dict[int, Exception] = {}
        if self._first not in self._trackers:
            self._first.switch(config, frame)
        for place, tracker in enumerate(self._trackers):
            self._tried(failures, place, partial(tracker.switch, config, frame))
        self.failures = failures
        self._watch_from(frame)

    def update(self, frame: Image, following: Image | None = None) -> list[Track]:
        """The targets in the next frame, in the order of their boxes; raw-frame pixels.

        `following` is the frame after this one, where it is at hand: see `SteadiedTracker.update`.
        """
        failures: dict[int, Exception] = {}
        self.motion = motion = self._moved(frame, self._boxes)
        expected = [
            self._tried(failures, place, partial(tracker.expect, motion))
            for place, tracker in enumerate(self._trackers)
        ]
        known = [box for box in expected if box is not None]
        if self._camera is not None and following is not None and len(known) == len(expected):
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

    def _watch_from(self, frame: Image) -> None:
        """Let the camera's motion begin with `frame`."""
        self._camera = self._first.camera()
        self.motion = self._moved(frame)

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
