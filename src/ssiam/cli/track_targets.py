"""`TargetSet`: targets that begin in different frames, tracked as one group."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from ssiam.cli.moments import PlannedTarget
from ssiam.track import Track
from ssiam.trackers import TrackerGroup
from ssiam.video import Frame


class TargetSet:
    """The targets of a run, each tracked from the frame in which it begins.

    Parameters
    ----------
    group : TrackerGroup
        Without targets.
    targets : sequence of PlannedTarget
    has_begun : callable
        Whether the target of an index has begun, given the index and a frame.

    Attributes
    ----------
    failures : mapping of str to Exception
        What failed in the last frame, by name: "target 2", "camera".
    """

    def __init__(
        self,
        group: TrackerGroup,
        targets: Sequence[PlannedTarget],
        has_begun: Callable[[int, Frame], bool],
    ) -> None:
        self._group = group
        self._targets = targets
        self._has_begun = has_begun
        self._order: list[int] = []  # indexes of the targets in the group, in its order
        self.failures: Mapping[str, Exception] = {}

    @property
    def waiting(self) -> list[PlannedTarget]:
        """The targets that have not begun."""
        return [each for index, each in enumerate(self._targets) if index not in self._order]

    def step(self, frame: Frame, following: Frame | None = None) -> list[Track | None]:
        """The targets in the next frame; None for those that have not begun.

        `following` is the frame after it, if that is available.
        """
        starting = [
            index
            for index in range(len(self._targets))
            if index not in self._order and self._has_begun(index, frame)
        ]
        tracks: list[Track | None] = [None] * len(self._targets)
        if self._order:
            # The camera motion to the following frame must leave out the new targets too.
            ahead = None if following is None or starting else following.image
            for index, track in zip(
                self._order, self._group.update(frame.image, ahead), strict=True
            ):
                tracks[index] = track
            self.failures = self._named_failures()
        if starting:
            motion = self._group.motion if self._order else None
            self._begin(frame, starting)
            for index in starting:
                tracks[index] = Track(self._targets[index].xywh, motion=motion, keyframe=True)
        return tracks

    def _begin(self, frame: Frame, starting: Sequence[int]) -> None:
        boxes = [self._targets[index].xywh for index in starting]
        if not self._order:
            self._group.init(frame.image, boxes)
        else:
            for box in boxes:
                tracker = self._group.new_tracker()
                tracker.init(frame.image, box)
                self._group.join(tracker, box)
        self._order += starting

    def _named_failures(self) -> dict[str, Exception]:
        failed = {
            f"target {self._order[position] + 1}": error
            for position, error in self._group.failures.items()
        }
        if self._group.camera_failure is not None:
            failed["camera"] = self._group.camera_failure
        return failed
