"""`TrackerGroup`: several targets in one video, with one estimate of the camera's motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import partial
from numbers import Real
from typing import Any, TypeVar

from ssiam.copying import NotPicklable
from ssiam.errors import ArgumentError, FrameSizeError
from ssiam.geometry import XYWH, Image, check_box, check_frame, short_repr, xywh_floats
from ssiam.motion import Motion, PrefetchingCameraMotion
from ssiam.stabilize import StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.followers import Decision, FrameResponse, FrameStep
from ssiam.trackers.identities import TargetPath, decisions
from ssiam.trackers.stabilized import StabilizedTracker

Result = TypeVar("Result")


class TrackerGroup(NotPicklable):
    """Tracks any number of targets with trackers of one kind.

    Threads: one thread at a time for the group and its trackers; several groups may run at once.

    The camera's motion is estimated once per frame, with all targets excluded, and the trackers
    share their networks. A group can be copied if its trackers can. It cannot be pickled.

    Parameters
    ----------
    tracker : StabilizedTracker
        Prototype: the group's trackers are clones of it.
    aware : bool
        Whether the targets know of each other: no object is taken for two of them, and identities
        are kept when targets cross. Needs `stabilize="predict"` and a tracker that lists its
        candidates, such as lite.
    keep_going : bool
        Whether `update` continues if a tracker raises. Its target is then reported as lost at its
        last box, `failures` has the error, and the tracker runs again in the next frame. If the
        motion estimate raises, the motion to this frame is unreliable. A frame of another size
        always raises `FrameSizeError`.

    Attributes
    ----------
    motion : Motion or None
        The camera's motion to the last frame; None with ``stabilize="off"``.
    failures : mapping of int to Exception
        Exceptions of trackers in the last `update` or `switch`, by the index of their box; empty
        unless `keep_going`.
    camera_failure : Exception or None
        Exception of the motion estimate in the last `update`.
    """

    _copy_hint = "make one in each process of a tracker loaded there"

    def __init__(
        self, tracker: StabilizedTracker, *, aware: bool = True, keep_going: bool = False
    ) -> None:
        self._prototype = tracker.clone()
        self._aware = aware
        self._keep_going = keep_going
        self._trackers: list[StabilizedTracker] = []
        self._paths: list[TargetPath] = []
        self._exclude: Sequence[Sequence[float]] = []  # boxes left out of the next motion estimate
        self._size_wh: tuple[int, int] | None = None
        self._camera: PrefetchingCameraMotion | None = None
        self.motion: Motion | None = None
        self.failures: Mapping[int, Exception] = {}
        self.camera_failure: Exception | None = None

    def __repr__(self) -> str:
        return f"TrackerGroup({self._prototype!r}, targets={len(self._trackers)})"

    def init(self, frame: Image, boxes: Sequence[Sequence[float]]) -> None:
        """Take the objects in `boxes` of `frame` as the targets; earlier targets are dropped.

        If an argument is refused, the group keeps its earlier targets.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
        boxes : sequence of (x, y, w, h)
            Raw-frame pixels. May be empty if targets `join` later.

        Raises
        ------
        ValueError
            `boxes` is not a list of boxes, or `StabilizedTracker.init` refuses the frame or a box.
        """
        size_wh = check_frame(frame)
        trackers = []
        for box in [check_box(each, size_wh) for each in _box_list(boxes)]:
            tracker = self._prototype.clone()
            tracker.init(frame, box)
            trackers.append(tracker)
        camera = self._prototype.new_camera()
        motion = None if camera is None else camera.update(frame)
        self._trackers, self._exclude, self._size_wh = trackers, list(boxes), size_wh
        self._camera, self.motion = camera, motion
        self._paths = []
        for each in self._exclude:
            self._paths.append(TargetPath(xywh_floats(each), self._paths))

    def new_tracker(self) -> StabilizedTracker:
        """A tracker of the group's kind without a target. Call its `init` before `join`."""
        return self._prototype.clone()

    def join(self, tracker: StabilizedTracker, box: Sequence[float]) -> None:
        """Add the target of `tracker`.

        Parameters
        ----------
        tracker : StabilizedTracker
        box : (x, y, w, h)
            The target's box in the last frame, raw-frame pixels.

        Raises
        ------
        ValueError
            The group has no frame yet, `tracker` has no target, has another stabilization or is
            already in the group, or the box does not have the form (x, y, w, h).
        """
        self._checked_size_wh()
        xywh = xywh_floats(box)
        if not isinstance(tracker, StabilizedTracker) or not tracker.has_target:
            raise ArgumentError("this tracker has no target: call its init(frame, box) before join")
        if tracker.config != self._prototype.config:
            raise ArgumentError(
                f"this tracker stabilizes by {tracker.config.stabilize!r} or by other numbers than "
                "the group: take one from new_tracker()"
            )
        if any(each is tracker for each in self._trackers):
            raise ArgumentError("this tracker is in the group already")
        self._trackers.append(tracker)
        self._paths.append(TargetPath(xywh, self._paths))
        self._exclude = [*self._exclude, xywh]

    def leave(self, tracker: StabilizedTracker) -> None:
        """Remove the target of `tracker`; `ValueError` if it is not in the group."""
        if not any(each is tracker for each in self._trackers):
            raise ArgumentError("this tracker is not in the group: it has left, or never joined")
        index = self._trackers.index(tracker)
        self._trackers = [*self._trackers[:index], *self._trackers[index + 1 :]]
        self._paths = [*self._paths[:index], *self._paths[index + 1 :]]
        self._exclude = [*self._exclude[:index], *self._exclude[index + 1 :]]

    def switch(self, config: StabilizerConfig, frame: Image) -> None:
        """Stabilize by `config` from now on.

        Parameters
        ----------
        config : StabilizerConfig
        frame : (H, W, 3) uint8 BGR
            The last frame that was given to the group.

        Raises
        ------
        ValueError
            As in `StabilizedTracker.switch`. With `keep_going` errors of the trackers are in
            `failures` instead; these trackers should `leave`.
        """
        check_frame(frame, self._size_wh)
        failures: dict[int, Exception] = {}
        self._prototype.switch(config, frame)
        for index, tracker in enumerate(self._trackers):
            self._attempt(failures, index, partial(tracker.switch, config, frame))
        self.failures = failures
        self._camera = self._prototype.new_camera()
        self.motion = self._estimate_motion(frame)

    def update(self, frame: Image, following: Image | None = None) -> list[Track]:
        """The targets in the next frame, in the order of their boxes; raw-frame pixels.

        Parameters
        ----------
        frame, following : (H, W, 3) uint8 BGR
            As in `StabilizedTracker.update`, also the errors.
        """
        size_wh = self._checked_size_wh()
        check_frame(frame, size_wh)
        can_prefetch = following is not None and check_frame(following) == size_wh
        failures: dict[int, Exception] = {}
        self.motion = motion = self._estimate_motion(frame, self._exclude)
        steps = [
            self._attempt(failures, index, partial(tracker.advance, motion))
            for index, tracker in enumerate(self._trackers)
        ]
        predicted = [None if step is None else step.predicted_xywh for step in steps]
        exclude = [box for box in predicted if box is not None]
        beside: AbstractContextManager[None] = nullcontext()
        if (
            self._camera is not None
            and can_prefetch
            and following is not None
            and len(exclude) == len(predicted)
        ):
            start = partial(self._camera.start, following, exclude=exclude)
            beside = self._prototype.beside_network(start)
        with beside:
            located = self._located(failures, frame, steps, motion)
        self.failures = failures
        tracks = [
            self._failed_track(index) if track is None else track
            for index, track in enumerate(located)
        ]
        self._exclude = [
            track.box if box is None else box for box, track in zip(predicted, tracks, strict=True)
        ]
        return tracks

    def _located(
        self,
        failures: dict[int, Exception],
        frame: Image,
        steps: Sequence[FrameStep | None],
        motion: Motion | None,
    ) -> list[Track | None]:
        """The targets in `frame`; None for those whose tracker has failed."""
        for path in self._paths:
            path.advance(motion)
        responses: list[FrameResponse | None] = [None] * len(steps)
        if self._aware and len(steps) > 1:
            responses = [
                None
                if step is None
                else self._attempt(failures, index, partial(tracker.respond, frame, step))
                for index, (tracker, step) in enumerate(zip(self._trackers, steps, strict=True))
            ]
        located: list[Track | None] = []
        decided = decisions(self._paths, responses)
        clear = [(path, path.predicted) for path in self._paths if path.frames_unclear <= 1]
        for index, (tracker, step) in enumerate(zip(self._trackers, steps, strict=True)):
            path, response, decision = self._paths[index], responses[index], decided[index]
            track = None
            if step is not None and index not in failures:
                if response is None:
                    others = [xywh for other, xywh in clear if other is not path and self._aware]
                    work = partial(tracker.locate, frame, step, others)
                else:
                    alone = Decision(response, response.response.best, True, path.predicted)
                    work = partial(tracker.decide, frame, step, decision or alone)
                track = self._attempt(failures, index, work)
            if track is not None:
                _observe(path, track, decision)
            located.append(track)
        return located

    def _attempt(
        self, failures: dict[int, Exception], index: int, work: Callable[[], Result]
    ) -> Result | None:
        """The result of `work`. If it raises: None, with the error in `failures` at `index`."""
        try:
            return work()
        except FrameSizeError:
            raise
        except Exception as error:
            if not self._keep_going:
                raise
            failures[index] = error
            return None

    def _failed_track(self, index: int) -> Track:
        """The track of a target whose tracker has failed."""
        x, y, w, h = map(float, self._exclude[index])
        box: XYWH = (x, y, w, h)
        return Track(box, score=0.0, lost=True, motion=self.motion)

    def _estimate_motion(
        self, frame: Image, exclude: Sequence[Sequence[float]] | None = None
    ) -> Motion | None:
        """The camera's motion to `frame`; None with ``stabilize="off"``."""
        self.camera_failure = None
        if self._camera is None:
            return None
        try:
            return self._camera.update(frame, exclude=exclude)
        except FrameSizeError:
            raise
        except Exception as error:
            if not self._keep_going:
                raise
            self.camera_failure = error
            return Motion.none((frame.shape[1], frame.shape[0]))

    def _checked_size_wh(self) -> tuple[int, int]:
        if self._size_wh is None:
            raise ArgumentError("no target yet: call init(frame, boxes) first")
        return self._size_wh


def _observe(path: TargetPath, track: Track, decision: Decision | None) -> None:
    """Continue a target's path by its track, which was decided or is the tracker's own choice."""
    if not track.lost and (decision is None or decision.is_clear):
        path.observe(track.box)
    elif decision is None:
        path.rest_at(track.box)
    elif decision.index >= 0:
        path.observe_unclear(decision.found.xywh(decision.index))


def _box_list(boxes: Any) -> list[Any]:
    """The boxes of a group as a list; `ArgumentError` if they are not a sequence of boxes."""
    box_list: list[Any] | None = None
    if not isinstance(boxes, str | bytes | Set | Mapping):
        with suppress(TypeError):
            box_list = list(boxes)
    if box_list is None or any(isinstance(each, Real) for each in box_list):
        raise ArgumentError(
            f"boxes is {short_repr(boxes)}: give a list of (x, y, width, height) in pixels"
        )
    return box_list
