"""`TrackerGroup`: several targets in one video, one estimate of the camera's motion."""

from __future__ import annotations

from collections.abc import Sequence

from ssiam.geometry import Image
from ssiam.motion import Motion, MotionAhead
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers.steadied import SteadiedTracker
from ssiam.trackers.track import Track


class TrackerGroup:
    """Follows any number of targets with trackers of one kind.

    The camera's motion is estimated once a frame, without the points on any of the targets; the
    trackers share their networks.

    Parameters
    ----------
    tracker : SteadiedTracker
        The others are made from it.

    Attributes
    ----------
    motion : Motion or None
        The camera's motion to the last frame; None with ``stabilize="off"``.
    """

    def __init__(self, tracker: SteadiedTracker) -> None:
        self._first = tracker
        self._trackers: list[SteadiedTracker] = []
        self._boxes: Sequence[Sequence[float]] = []
        self._camera: MotionAhead | None = None
        self.motion: Motion | None = None

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
        """Steady by `config` from now on; `frame` is the last one."""
        for tracker in {self._first, *self._trackers}:
            tracker.switch(config, frame)
        self._watch_from(frame)

    def update(self, frame: Image, following: Image | None = None) -> list[Track]:
        """The targets in the next frame, in the order of their boxes; raw-frame pixels.

        `following` is the frame after this one, where it is at hand: see `SteadiedTracker.update`.
        """
        motion = None
        if self._camera is not None:
            motion = self._camera.update(frame, exclude=self._boxes)
        self.motion = motion
        expected = [tracker.expect(motion) for tracker in self._trackers]
        known = [box for box in expected if box is not None]
        if self._camera is not None and following is not None and len(known) == len(expected):
            self._camera.start(following, exclude=known)
        tracks = [tracker.look(frame) for tracker in self._trackers]
        self._boxes = known or [track.box for track in tracks]
        return tracks

    def _watch_from(self, frame: Image) -> None:
        """Let the camera's motion begin with `frame`."""
        self._camera = self._first.camera()
        self.motion = None if self._camera is None else self._camera.update(frame)
