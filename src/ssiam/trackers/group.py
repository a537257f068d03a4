"""`TrackerGroup`: several targets in one video, one estimate of the camera's motion."""

from __future__ import annotations

from collections.abc import Sequence

from ssiam.geometry import Image
from ssiam.motion import MotionAhead
from ssiam.trackers.steadied import SteadiedTracker
from ssiam.trackers.track import Track


class TrackerGroup:
    """Follows any number of targets with trackers of one kind.

    The camera's motion is estimated once a frame, without the points on any of the targets; the
    trackers share their networks.

    Parameters
    ----------
    tracker : SteadiedTracker
        Follows the first target; the others are made from it.
    """

    def __init__(self, tracker: SteadiedTracker) -> None:
        self._first = tracker
        self._trackers: list[SteadiedTracker] = []
        self._camera: MotionAhead | None = None

    def init(self, frame: Image, boxes: Sequence[Sequence[float]]) -> None:
        """Take the targets in `boxes` (x, y, w, h) of `frame`; errors as `SteadiedTracker`."""
        others = [self._first.another() for _ in boxes[1:]]
        self._trackers = [self._first, *others][: len(boxes)]
        for tracker, box in zip(self._trackers, boxes, strict=True):
            tracker.init(frame, box)
        self._boxes: Sequence[Sequence[float]] = list(boxes)
        self._camera = self._first.camera()
        if self._camera is not None:
            self._camera.update(frame)

    def update(self, frame: Image, following: Image | None = None) -> list[Track]:
        """The targets in the next frame, in the order of their boxes; raw-frame pixels.

        `following` is the frame after this one, where it is at hand: see `SteadiedTracker.update`.
        """
        motion = None
        if self._camera is not None:
            motion = self._camera.update(frame, exclude=self._boxes)
        expected = [tracker.expect(motion) for tracker in self._trackers]
        known = [box for box in expected if box is not None]
        if self._camera is not None and following is not None and len(known) == len(expected):
            self._camera.start(following, exclude=known)
        tracks = [tracker.look(frame) for tracker in self._trackers]
        self._boxes = known or [track.box for track in tracks]
        return tracks
