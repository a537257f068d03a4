"""`Targets`: the targets of a live session, added and removed while it runs."""

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
from ssiam.web.types import (
    MAX_NAME_LENGTH,
    CommandError,
    Target,
    WaitingTarget,
    normalized_name,
)


@dataclass
class _TargetState:
    """A target, its first box and its last track; `tracker` is None until it is initialized."""

    id: int
    name: str
    color: str
    first_index: int  # of the frame in which the box was drawn
    first_xywh: XYWH
    tracker: StabilizedTracker | None = None
    track: Track | None = None
    redetected: bool = False
    error: str = ""


class Targets:
    """Tracks the targets of a session, with one camera motion for all.

    If a tracker raises an exception, its target counts as lost in this frame, and the tracker runs
    again on the next one. A target whose tracker cannot be initialized or switched is removed.
    Other targets are not affected.

    Parameters
    ----------
    tracker : StabilizedTracker
        Prototype of the targets' trackers.
    max_targets : int
        Maximum number of targets.
    report_error : callable
        Called with a context and an exception; must return the exception as one line.
    """

    def __init__(
        self,
        tracker: StabilizedTracker,
        max_targets: int,
        report_error: Callable[[str, Exception], str],
    ) -> None:
        self._group = TrackerGroup(tracker, keep_going=True)
        self._report_error = report_error
        self._config = tracker.config
        self._max_targets = max_targets
        self._states: list[_TargetState] = []
        self._last_id = 0
        self._last_index = -1  # of the last frame; targets drawn up to it do not begin any more

    def __len__(self) -> int:
        return len(self._states)

    @property
    def config(self) -> StabilizerConfig:
        """Stabilization of the trackers."""
        return self._config

    @property
    def motion(self) -> Motion | None:
        """Camera motion to the last frame."""
        return self._group.motion

    def begin(self, frame: Frame, first_index: int = 0) -> None:
        """Start a sequence on its first frame; targets start again at their first boxes.

        Targets that were drawn in frames before `first_index` wait for the next sequence.
        """
        self._group.init(frame.image, [])
        for state in self._states:
            state.tracker = state.track = None
            state.redetected, state.error = False, ""
        self._report_camera_failure()
        self._last_index = min(first_index, frame.index) - 1
        self._init_pending(frame)

    def update(self, frame: Frame) -> None:
        """Track all targets in the next frame."""
        running = [state for state in self._states if state.tracker is not None]
        tracks = self._group.update(frame.image)
        for index, (state, track) in enumerate(zip(running, tracks, strict=True)):
            error = self._group.failures.get(index)
            # A frame in which the tracker failed counts neither as a loss nor as a re-detection.
            was_lost = state.track is not None and state.track.lost and not state.error
            state.redetected = was_lost and not track.lost
            state.track = track
            context = f"the tracker of {state.name}"
            state.error = "" if error is None else self._report_error(context, error)
        self._report_camera_failure()
        self._init_pending(frame)

    def add(self, frames: Sequence[Frame], xywh: XYWH, name: str | None) -> int:
        """Add the target in `xywh` of the first of `frames`, tracked through the others.

        Parameters
        ----------
        frames : sequence of Frame
            In order; the last one is the newest frame of the session.
        xywh : (x, y, w, h)
            Raw-frame pixels.
        name : str or None

        Returns
        -------
        int
            The target's id.

        Raises
        ------
        CommandError
            There are too many targets, or the box or the name cannot be used.
        """
        if len(self._states) >= self._max_targets:
            text = f"{self._max_targets} targets are tracked already: remove one first"
            raise CommandError("too-many-targets", text)
        name = _checked_name(name or f"target {self._last_id + 1}")
        tracker = self._group.new_tracker()
        try:
            tracker.init(frames[0].image, xywh)
        except ArgumentError as error:
            raise CommandError("bad-box", str(error)) from error
        track = Track(xywh)
        for frame in frames[1:]:
            track = tracker.update(frame.image)
        id = self._last_id + 1
        color = target_color(id - 1)
        state = _TargetState(id, name, color, frames[0].index, xywh, tracker, track)
        self._group.join(tracker, track.box)
        self._states.append(state)
        self._last_id = id
        return id

    def remove(self, id: int | None) -> None:
        """Remove the target with this id; None removes all."""
        removed = self._states if id is None else [self._state(id)]
        for state in removed:
            if state.tracker is not None:
                self._group.leave(state.tracker)
        self._states = [state for state in self._states if state not in removed]

    def rename(self, id: int, name: str) -> None:
        """Rename a target."""
        self._state(id).name = _checked_name(name)

    def switch(self, config: StabilizerConfig, frame: Frame) -> None:
        """Stabilize by `config` from the frame after `frame` on, which is the newest one.

        Targets whose trackers cannot be switched are removed.
        """
        self._config = config
        running = [state for state in self._states if state.tracker is not None]
        self._group.switch(config, frame.image)
        for index, error in self._group.failures.items():
            context = f"is removed because it cannot be switched to {config.stabilize}"
            self._give_up(running[index], context, error)
        self._report_camera_failure()

    def snapshot(self) -> tuple[Target, ...]:
        """The current state of all targets that have been initialized."""
        return tuple(
            Target(each.id, each.name, each.color, each.track, each.redetected, each.error)
            for each in self._states
            if each.track is not None
        )

    def waiting(self) -> tuple[WaitingTarget, ...]:
        """The targets that are not tracked, because they begin in another frame."""
        return tuple(
            WaitingTarget(each.id, each.name, each.color, each.first_index)
            for each in self._states
            if each.track is None
        )

    def _init_pending(self, frame: Frame) -> None:
        """Initialize targets that were drawn in this frame, or in a dropped one before it."""
        last_index, self._last_index = self._last_index, frame.index
        for state in list(self._states):
            if state.tracker is not None or not last_index < state.first_index <= frame.index:
                continue
            tracker = self._group.new_tracker()
            try:
                tracker.init(frame.image, state.first_xywh)
            except Exception as error:
                context = "is removed because it cannot be initialized in this frame"
                self._give_up(state, context, error)
                continue
            state.tracker, state.track = tracker, Track(state.first_xywh)
            self._group.join(tracker, state.first_xywh)

    def _give_up(self, state: _TargetState, context: str, error: Exception) -> None:
        """Remove a target because of an error."""
        self._report_error(f"{state.name} {context}", error)
        self.remove(state.id)

    def _report_camera_failure(self) -> None:
        if self._group.camera_failure is not None:
            context = "the camera motion to this frame"
            self._report_error(context, self._group.camera_failure)

    def _state(self, id: int) -> _TargetState:
        for state in self._states:
            if state.id == id:
                return state
        raise CommandError("no-such-target", f"there is no target {id}")


def _checked_name(name: str) -> str:
    normalized = normalized_name(name)
    if normalized is None:
        text = f"a name has 1 to {MAX_NAME_LENGTH} printable characters"
        raise CommandError("not-possible", text)
    return normalized


def target_color(index: int) -> str:
    """The color ``#rrggbb`` of the target with this index, from 0; as in annotated videos."""
    bgr = COLORS[index % len(COLORS)]
    return "#" + "".join(f"{math.floor(value):02x}" for value in reversed(bgr))
