"""`TrackerGroup`: several targets in one video, one estimate of the camera's motion."""

from __future__ import annotations

from collections.abc import Sequence

from ssiam.geometry import Image
from ssiam.motion import CameraMotion
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
        self._camera: CameraMotion | None = None

    def init(self, frame: Image, boxes: Sequence[Sequence[float]]) -> None:
        """Take the targets in `boxes` (x, y, w, h) of `frame`; errors as `SteadiedTracker`."""
        others = [self._first.another() for _ in boxes[1:]]
        self._trackers = [self._first, *others][: len(boxes)]
        for tracker, box in zip(self._trackers, boxes, strict=True):
            tracker.init(frame, box)
        self._boxes = [tuple(float(v) for v in box) for box in boxes]
        self._camera = self._first.camera()
        if self._camera is not None:
            self._camera.update(frame)

    def update(self, frame: Image) -> list[Track]:
        """The targets in the next frame, in the order of their boxes; raw-frame pixels."""
        motion = None
        if self._camera is not None:
            motion = self._camera.update(frame, exclude=self._boxes)
        tracks = [tracker.update(frame, motion=motion) for tracker in self._trackers]
        self._boxes = [track.box for track in tracks]
        return tracks
