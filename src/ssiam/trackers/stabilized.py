"""`StabilizedTracker`: camera motion, stabilization, any tracker, inverse mapping (Fig. 2)."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from ssiam.copying import NotPicklable
from ssiam.errors import ArgumentError, CopyError, SsiamError, TrackingError
from ssiam.geometry import (
    XYWH,
    Image,
    area_preserving_xywh,
    check_box,
    check_frame,
    finite_array,
    short_repr,
)
from ssiam.inferences import started_by_inference
from ssiam.motion import CameraMotion, MaskOf, Motion, PrefetchingCameraMotion
from ssiam.motion.motion import as_motion
from ssiam.stabilize import FrameView, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker, ViewTracker
from ssiam.trackers.blank_frames import BlankFrameDetector
from ssiam.trackers.followers import (
    Decision,
    Follower,
    FrameResponse,
    FrameStep,
    StabilizedFollower,
)
from ssiam.trackers.foreign import complete
from ssiam.trackers.lost import LossDetector
from ssiam.trackers.predictive_follower import PredictiveFollower

# Score up to which the target is considered not visible in a frame whose motion is unknown. Scores
# on noise are at most 0.08. With 0.3, a target would be held at its old position after a strong
# shake although it is visible.
_NOT_VISIBLE: Final = 0.1
_MAX_DISTANCE: Final = 10_000.0  # of a target from the origin, in longer sides of the frame


@dataclass
class _Target:
    """The state of one target, made by `init`."""

    size_wh: tuple[int, int]  # of all frames
    xywh: XYWH  # as last reported
    exclude_xywh: XYWH  # excluded from the next motion estimate: the predicted box if there is one
    loss: LossDetector
    blanks: BlankFrameDetector
    follower: Follower
    camera: PrefetchingCameraMotion | None

    def is_blank(self, frame: Image, step: FrameStep) -> bool:
        """Whether `frame` shows nothing where the target is searched; once for each frame."""
        return self.blanks.is_blank(frame, step.search_xywh, lost=self.loss.lost)


class StabilizedTracker(NotPicklable):
    """A tracker that runs on the stabilized view of each frame and returns raw-frame pixels.

    Threads: one thread at a time for each object; several objects, also clones of one, may run at
    once. The frame given as `following` is read in a separate thread until it is given to `update`.

    Use `load_tracker` to make one. An object tracks one target; `clone` makes a tracker for a
    second target, which shares only the networks. Copies (`copy.copy` and `copy.deepcopy`) keep the
    target and share the networks too; OpenCV's trackers cannot be copied while they have a target.
    Trackers cannot be pickled: load one in each process.

    Parameters
    ----------
    tracker : ViewTracker
        Any object with ``init(view, xywh)`` and ``update(view)``; `ssiam.trackers.base` lists what
        it may have besides.
    config : StabilizerConfig
    static_mask : (H, W) bool or uint8, or callable, optional
        What moves with the camera, which is left out of the camera's motion; see `CameraMotion`.
    """

    _copy_hint = "load one in each process with ssiam.load_tracker"

    def __init__(
        self,
        tracker: ViewTracker,
        config: StabilizerConfig,
        static_mask: ArrayLike | MaskOf | None = None,
    ) -> None:
        _check_config(config)
        CameraMotion(mask=static_mask)  # raises
        self._tracker, self._static_mask = complete(tracker), static_mask
        self._config = config
        self._target: _Target | None = None

    def __repr__(self) -> str:
        target = "" if self._target is None else ", has_target=True"
        return f"StabilizedTracker({self._tracker.name}, {self._config!r}{target})"

    @property
    def config(self) -> StabilizerConfig:
        """How the frames are stabilized."""
        return self._config

    @property
    def view_tracker(self) -> CompleteTracker:
        """The tracker that runs on the stabilized views."""
        return self._tracker

    @property
    def score_is_calibrated(self) -> bool:
        """Whether `Track.score` is the probability that the IoU of the box exceeds 0.5.

        If not, it is the tracker's own score, and a lost target may be reported late or early.
        """
        return self._tracker.score_is_calibrated

    @property
    def has_target(self) -> bool:
        """Whether `init` has been called."""
        return self._target is not None

    def new_camera(self) -> PrefetchingCameraMotion | None:
        """A new motion estimator with this tracker's settings; None with ``stabilize="off"``."""
        return self._new_camera(self._config)

    def clone(self) -> StabilizedTracker:
        """A tracker of the same kind and settings without a target, on the same networks."""
        return StabilizedTracker(self._tracker.clone(), self._config, self._static_mask)

    def init(self, frame: Image, box: Sequence[float]) -> None:
        """Take the object in `box` of `frame` as the target; an earlier target is dropped.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
        box : (x, y, w, h), or (x1, y1, x2, y2, x3, y3, x4, y4)
            Raw-frame pixels, 0-based, floats allowed. Of the corners of a rotated box, the
            tracker gets the upright box of the same center and area.

        Raises
        ------
        ValueError
            The frame is not an image, or the box is empty, not finite or outside of the frame.
        """
        size_wh = check_frame(frame)
        xywh = _first_box(box, size_wh, self._tracker)
        loss, blanks = LossDetector(), BlankFrameDetector(frame)
        follower, camera = self._new_follower(self._config, frame, xywh, loss)
        self._tracker.init(_raw_view(frame, self._config), xywh)
        self._target = _Target(size_wh, xywh, xywh, loss, blanks, follower, camera)

    def switch(self, config: StabilizerConfig, frame: Image) -> None:
        """Stabilize by `config` from now on, and keep the target.

        The template is kept if the tracker can seek; otherwise it is taken again from `frame`.

        Parameters
        ----------
        config : StabilizerConfig
        frame : (H, W, 3) uint8 BGR
            The last frame that was given to this tracker.

        Raises
        ------
        ValueError
            `config` is not a `StabilizerConfig`, or the frame is not an image.
        FrameSizeError
            The frame's size differs from that of the first one.
        """
        _check_config(config)
        target = self._target
        check_frame(frame, None if target is None else target.size_wh)
        if target is None:
            self._config = config
            return
        follower, camera = self._new_follower(config, frame, target.xywh, target.loss)
        view = _raw_view(frame, config)
        if self._tracker.can_seek:
            self._tracker.seek(view, target.xywh)
        else:
            self._tracker.init(view, target.xywh)
        self._config = config
        target.exclude_xywh = target.xywh
        target.follower, target.camera = follower, camera

    def update(
        self, frame: Image, motion: Motion | None = None, following: Image | None = None
    ) -> Track:
        """The target in the next frame, raw-frame pixels.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
            Of the same size as the first one.
        motion : Motion, optional
            The camera's motion to this frame, if it is already known: several targets in one
            video can share one estimate. By default it is estimated from the frames.
        following : (H, W, 3) uint8 BGR, optional
            The frame after this one, if it is available: the camera's motion to it is then
            estimated in a separate thread while the tracker runs. It must be the next frame given
            to `update`, and must not be written to until then. Results do not depend on it.

        Raises
        ------
        ValueError
            There is no target yet, the frame is not an image or not the one that was given as
            `following`, or `following` or `motion` has the wrong form.
        FrameSizeError
            The frame's size differs from that of the first one.
        TrackingError
            The tracker fails on this frame, or the motions have carried the target out of all
            bounds.
        """
        target = self._current_target()
        check_frame(frame, target.size_wh)
        # A following frame of another size is refused later, when it is given to `update`.
        can_prefetch = following is not None and check_frame(following) == target.size_wh
        if motion is not None:
            motion = as_motion(motion, target.size_wh)
        camera = target.camera
        if camera is not None:
            motion = camera.update(frame, target.exclude_xywh, motion)
        with _arithmetic_as_tracking_error():
            step = self._advance(target, motion)
            is_blank = target.is_blank(frame, step)
            if camera and can_prefetch and following is not None and step.predicted_xywh:
                start = partial(camera.start, following, step.predicted_xywh, target.blanks.prepare)
                with self.beside_network(start):
                    return self._locate(target, frame, step, is_blank)
            return self._locate(target, frame, step, is_blank)

    def beside_network(self, start: Callable[[], None]) -> AbstractContextManager[None]:
        """Call `start`, which starts another thread, when the block's first network begins.

        Without networks it is called at once.
        """
        if self._tracker.runs_networks:
            return started_by_inference(start)
        start()
        return nullcontext()

    def advance(self, motion: Motion | None) -> FrameStep:
        """The first half of `update`, for callers that estimate the motion themselves.

        Parameters
        ----------
        motion : Motion or None
            The camera's motion to the next frame; None with ``stabilize="off"``.

        Returns
        -------
        FrameStep
            To be passed to `locate`, once, before the next `advance`.

        Raises
        ------
        ValueError
            There is no target yet, no motion although ``stabilize="predict"`` needs one, or one
            that is not finite or of frames of another size.
        TrackingError
            The motions have carried the target out of all bounds.
        """
        target = self._current_target()
        if motion is not None:
            motion = as_motion(motion, target.size_wh)
        with _arithmetic_as_tracking_error():
            return self._advance(target, motion)

    def locate(self, frame: Image, step: FrameStep, taken: Sequence[XYWH] = ()) -> Track:
        """The second half of `update`: the target in `frame`, raw-frame pixels.

        `step` is the result of `advance` for this frame. `taken` are the boxes of other targets,
        where a lost one is not found. The errors are those of `update`.
        """
        target = self._current_target()
        check_frame(frame, target.size_wh)
        with _arithmetic_as_tracking_error():
            return self._locate(target, frame, step, target.is_blank(frame, step), taken=taken)

    def respond(self, frame: Image, step: FrameStep) -> FrameResponse | None:
        """The tracker's candidates in `frame`, for a decision in place of `locate`.

        Nothing is changed by it. None if there are no candidates: the tracker does not list them, a
        lost target is searched for, or the camera's motion is unknown. `step` is the result of
        `advance` for this frame. The errors are those of `update`.
        """
        target = self._current_target()
        check_frame(frame, target.size_wh)
        if step.is_motion_unknown:
            return None
        with _arithmetic_as_tracking_error():
            return target.follower.respond(frame, step)

    def decide(self, frame: Image, step: FrameStep, decision: Decision) -> Track:
        """The target by a decision among the candidates of `respond`, instead of `locate`."""
        target = self._current_target()
        check_frame(frame, target.size_wh)
        with _arithmetic_as_tracking_error():
            return self._locate(target, frame, step, target.is_blank(frame, step), decision)

    def _advance(self, target: _Target, motion: Motion | None) -> FrameStep:
        """As `advance`, by a valid motion."""
        step = target.follower.advance(motion)
        if not _is_within_bounds(step, target.size_wh):
            raise OverflowError
        return step

    def _locate(
        self,
        target: _Target,
        frame: Image,
        step: FrameStep,
        is_blank: bool,
        decision: Decision | None = None,
        taken: Sequence[XYWH] = (),
    ) -> Track:
        if is_blank:
            track = target.follower.hold(step)
        elif decision is not None:
            track = target.follower.decide(step, decision)
        else:
            track = self._locate_visible(target, frame, step, taken)
        if track.lost:
            track = track.with_changes(box=_touching(track.box, target.size_wh))
        target.xywh = track.box
        target.exclude_xywh = step.predicted_xywh or track.box
        return track

    def _locate_visible(
        self, target: _Target, frame: Image, step: FrameStep, taken: Sequence[XYWH]
    ) -> Track:
        """The target in a frame that is not blank.

        If neither the camera's motion nor the target is found in it (noise, a torn frame, another
        scene), it is handled as a blank frame, and the tracker's state is restored. OpenCV's
        trackers cannot be copied: for them the track is used as it is.
        """
        before = None
        if step.is_motion_unknown:
            with suppress(CopyError):
                before = copy.deepcopy((target.follower, self._tracker, target.loss))
        track = target.follower.locate(frame, step, taken)
        if before is None or track.score > _NOT_VISIBLE:
            return track
        target.follower, self._tracker, target.loss = before
        return target.follower.hold(step)

    def _current_target(self) -> _Target:
        if self._target is None:
            raise ArgumentError("no target yet: call init(frame, box) before update(frame)")
        return self._target

    def _new_follower(
        self, config: StabilizerConfig, frame: Image, xywh: XYWH, loss: LossDetector
    ) -> tuple[Follower, PrefetchingCameraMotion | None]:
        """A follower of the target in `xywh`, and a motion estimator; both start with `frame`."""
        make = PredictiveFollower if config.stabilize == "predict" else StabilizedFollower
        follower, camera = make(self._tracker, config, xywh, loss), self._new_camera(config)
        if camera is not None:
            follower.advance(camera.update(frame))
        return follower, camera

    def _new_camera(self, config: StabilizerConfig) -> PrefetchingCameraMotion | None:
        if config.stabilize == "off":
            return None
        camera = CameraMotion(
            config.keypoints, config.fit, config.motion_model, config.spread, self._static_mask
        )
        return PrefetchingCameraMotion(camera)


@contextmanager
def _arithmetic_as_tracking_error() -> Iterator[None]:
    """Report numbers that are not finite, or too large for pixels, as a `TrackingError`."""
    try:
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            yield
    except SsiamError:
        raise
    except (ArithmeticError, ValueError, cv2.error) as error:
        raise TrackingError(
            "the motions given have carried the target out of all bounds: call init(frame, box)"
        ) from error


def _is_within_bounds(step: FrameStep, size_wh: tuple[int, int]) -> bool:
    limit = _MAX_DISTANCE * max(size_wh)
    numbers = (*step.search_xywh, *step.stab_from_raw.ravel().tolist())
    return all(abs(number) <= limit for number in numbers)


def _check_config(config: StabilizerConfig) -> None:
    if not isinstance(config, StabilizerConfig):
        raise ArgumentError(f"config is {short_repr(config)}: give a StabilizerConfig")


def _first_box(box: Sequence[float], size_wh: tuple[int, int], tracker: CompleteTracker) -> XYWH:
    """The upright box of `box`, four numbers or the eight of its corners."""
    corners = finite_array(box)
    if corners is None or corners.shape != (8,):
        return check_box(box, size_wh)
    if not np.ptp(corners.reshape(4, 2), axis=0).all():
        raise ArgumentError(f"box {short_repr(box)} is empty: its corners are on one line")
    return check_box(area_preserving_xywh(corners, tracker.center_inset), size_wh)


def _raw_view(frame: Image, config: StabilizerConfig) -> FrameView:
    return FrameView(frame, border=0 if config.stabilize == "off" else config.border)


def _touching(xywh: XYWH, size_wh: tuple[int, int]) -> XYWH:
    """The box; if it is outside of the frame of (width, height), moved to touch it."""
    x, y, w, h = xywh
    width, height = size_wh
    return min(max(x, -w), float(width)), min(max(y, -h), float(height)), w, h
