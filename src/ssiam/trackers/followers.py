"""Followers: how one target is tracked from frame to frame with each kind of stabilization.

A `Follower` handles each frame in two steps. `advance` takes the camera's motion to the frame and
returns a `FrameStep`: the stabilizing transform and the box around which the target is searched.
`locate` runs the tracker on that view. `StabilizedFollower` stabilizes as the paper does, or not at
all; `PredictiveFollower`, in a file of its own, predicts the target's box.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from ssiam.geometry import IDENTITY, XYWH, Image, Transform, inverse, map_box
from ssiam.motion import Motion
from ssiam.stabilize import FrameView, Stabilizer, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.lost import LossDetector
from ssiam.trackers.responses import Response


@dataclass(frozen=True, eq=False)
class FrameStep:
    """The step to one frame: its stabilizing transform, and where the target is searched in it.

    Attributes
    ----------
    motion : Motion or None
        The camera's motion to the frame; None with ``stabilize="off"``.
    stab_from_raw : (3, 3) float64
    search_xywh : (x, y, w, h)
        The box around which the tracker searches, raw-frame pixels.
    predicted_xywh : (x, y, w, h) or None
        The target's predicted box, raw-frame pixels; None without a prediction.
    """

    motion: Motion | None
    stab_from_raw: Transform
    search_xywh: XYWH
    predicted_xywh: XYWH | None = None

    @property
    def is_motion_unknown(self) -> bool:
        """Whether the camera's motion to the frame was estimated but is not reliable."""
        return self.motion is not None and not self.motion.reliable


@dataclass(frozen=True, eq=False)
class FrameResponse:
    """A tracker's response to a frame, before one of the candidates is taken.

    Attributes
    ----------
    view : FrameView
    response : Response
    """

    view: FrameView
    response: Response

    def xywh(self, index: int) -> XYWH:
        """The box of a candidate, raw-frame pixels."""
        return map_box(self.view.raw_from_stab, self.response.xywh(index))


@dataclass(frozen=True, eq=False)
class Decision:
    """What a target in a group is decided to be.

    Attributes
    ----------
    found : FrameResponse
    index : int
        The candidate to be taken; -1 for a target that is hidden by another one.
    is_clear : bool
        Whether the candidate's box is that of the target alone.
    assumed_xywh : (x, y, w, h)
        Where the target is assumed to be if its box is not clear, raw-frame pixels.
    """

    found: FrameResponse
    index: int
    is_clear: bool
    assumed_xywh: XYWH


class Follower(Protocol):
    """Follows one target with a `CompleteTracker`, in raw-frame pixels.

    Its constructor takes a tracker that has a target, a `StabilizerConfig`, the target's box in
    raw-frame pixels and the target's `LossDetector`. For each frame `advance` is called first, then
    `locate` or `hold` with its result.
    """

    def advance(self, motion: Motion | None) -> FrameStep:
        """Move on to the next frame, reached by `motion`."""

    def locate(self, frame: Image, step: FrameStep, taken: Sequence[XYWH] = ()) -> Track:
        """The target in `frame`; `step` is the result of `advance` for this frame.

        `taken` are the boxes of other targets, where a lost one is not found; raw-frame pixels.
        """

    def respond(self, frame: Image, step: FrameStep) -> FrameResponse | None:
        """The tracker's candidates in `frame`; None if it cannot list them now."""

    def decide(self, step: FrameStep, decision: Decision) -> Track:
        """The target by a decision among the candidates of `respond`, instead of `locate`."""

    def hold(self, step: FrameStep) -> Track:
        """The target in a blank frame: the tracker does not run, and the box keeps its position.

        `step` is the result of `advance` for this frame.
        """


class StabilizedFollower:
    """A tracker on frames that are stabilized as in the paper, or not at all.

    Parameters
    ----------
    tracker : CompleteTracker
        A tracker that has a target.
    config : StabilizerConfig
    xywh : (x, y, w, h)
        The target, raw-frame pixels.
    loss : LossDetector
    """

    def __init__(
        self, tracker: CompleteTracker, config: StabilizerConfig, xywh: XYWH, loss: LossDetector
    ) -> None:
        self._tracker = tracker
        self._stabilizer = Stabilizer(config)
        self._border = 0 if config.stabilize == "off" else config.border
        self._loss = loss
        self._stab_xywh = xywh  # where the tracker searches, stabilized pixels

    def advance(self, motion: Motion | None) -> FrameStep:
        """Move on to the next frame; nothing is predicted."""
        if motion is None:
            return FrameStep(None, IDENTITY, self._stab_xywh)
        stab_from_raw = self._stabilizer.update(motion)
        return FrameStep(motion, stab_from_raw, map_box(inverse(stab_from_raw), self._stab_xywh))

    def locate(self, frame: Image, step: FrameStep, taken: Sequence[XYWH] = ()) -> Track:
        """The target in `frame`, raw-frame pixels."""
        view = FrameView(frame, step.stab_from_raw, self._border)
        track = self._tracker.update(view)
        self._stab_xywh = track.box
        self._loss.update(track.score)
        if step.motion is None:
            return track.with_changes(lost=self._loss.lost)
        return track.mapped(view.raw_from_stab, view.size_wh).with_changes(
            lost=self._loss.lost,
            motion=step.motion,
            stab_from_raw=step.stab_from_raw,
        )

    def respond(self, frame: Image, step: FrameStep) -> FrameResponse | None:
        """None: positions are not predicted, so that nothing could be decided by them."""
        return None

    def decide(self, step: FrameStep, decision: Decision) -> Track:
        """Not called: there are no responses."""
        raise NotImplementedError

    def hold(self, step: FrameStep) -> Track:
        """The target in a blank frame, at its stabilized position."""
        self._loss.skip_blank()
        track = Track(step.search_xywh, 0.0, self._loss.lost)
        if step.motion is None:
            return track
        return track.with_changes(motion=step.motion, stab_from_raw=step.stab_from_raw)
