"""`SteadiedTracker`: camera motion, steadying, any tracker, and the way back (Fig. 2)."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

from ssiam.copying import NotPicklable
from ssiam.errors import ArgumentError, CopyError
from ssiam.geometry import XYWH, Image, check_box, check_frame, short_repr
from ssiam.motion import CameraMotion, Motion, PrefetchingCameraMotion
from ssiam.motion.motion import as_motion
from ssiam.stabilize import FrameView, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.base import ViewTracker
from ssiam.trackers.pursuit import Pursuit
from ssiam.trackers.sight import Sight
from ssiam.trackers.steadying import Steadying
from ssiam.trackers.watch import Watch

# Score up to which nothing of the target is seen in a frame whose motion is not known either. Noise
# scores .08 at most; with .3 a target that a strong shake has moved is held where it was.
_FLAT: Final = 0.1


class SteadiedTracker(NotPicklable):
    """A tracker that works on the steadied view of each frame and answers in raw pixels.

    Threads: one thread at a time for each object; several, also of one load, may run at once. The
    frame given as `following` is read in a thread of its own until it is given to `update`.

    Made by `load_tracker`. One object follows one target; `another` gives one for a second
    target, which shares the networks and nothing else. So does a copy (`copy.copy` or
    `copy.deepcopy`), which has the target too; OpenCV's trackers are only copied without one. None
    is pickled: load one in each process.

    Parameters
    ----------
    tracker : ViewTracker
    config : StabilizerConfig
    """

    _copy_hint = "load one in each process with ssiam.load_tracker"

    def __init__(self, tracker: ViewTracker, config: StabilizerConfig) -> None:
        if not isinstance(config, StabilizerConfig):
            raise ArgumentError(f"config is {short_repr(config)}: give a StabilizerConfig")
        self._tracker = tracker
        self._config = config
        self._box: XYWH | None = None

    @property
    def config(self) -> StabilizerConfig:
        """How this tracker steadies its frames."""
        return self._config

    @property
    def has_target(self) -> bool:
        """Whether `init` has given it a target."""
        return self._box is not None

    def camera(self) -> PrefetchingCameraMotion | None:
        """A fresh motion estimator of this tracker's settings, None with stabilize="off"."""
        return _camera(self._config)

    def another(self) -> SteadiedTracker:
        """A tracker of the same kind and settings, without a target, on the same networks."""
        return SteadiedTracker(self._tracker.another(), self._config)

    def init(self, frame: Image, box: Sequence[float]) -> None:
        """Take the target in `box` of `frame` as the one to follow.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
        box : (x, y, w, h)
            Raw-frame pixels, 0-based, floats allowed.

        Raises
        ------
        ValueError
            The frame is not an image, or the box is empty, not finite or outside of it.
        """
        size_wh = check_frame(frame)
        xywh, watch, sight = check_box(box, size_wh), Watch(), Sight(frame)
        follower, camera = self._started(self._config, frame, xywh, watch)
        self._tracker.init(_unsteadied(frame, self._config), xywh)
        self._box = self._seen = xywh
        self._size_wh, self._watch, self._sight = size_wh, watch, sight
        self._follower, self._camera = follower, camera

    def switch(self, config: StabilizerConfig, frame: Image) -> None:
        """Steady by `config` from now on, and keep the target.

        Its template is kept too, where the tracker can be told where to look.

        Parameters
        ----------
        config : StabilizerConfig
        frame : (H, W, 3) uint8 BGR
            The one that was given last.

        Raises
        ------
        ValueError
            It is no `StabilizerConfig`, or the frame is not an image.
        FrameSizeError
            The frame's size is not that of the first one.
        """
        if not isinstance(config, StabilizerConfig):
            raise ArgumentError(f"config is {short_repr(config)}: give a StabilizerConfig")
        check_frame(frame, None if self._box is None else self._size_wh)
        if self._box is None:
            self._config = config
            return
        follower, camera = self._started(config, frame, self._seen, self._watch)
        view = _unsteadied(frame, config)
        if self._tracker.doubt is None:
            self._tracker.init(view, self._seen)
        else:
            self._tracker.seek(view, self._seen)
        self._box, self._config = self._seen, config
        self._follower, self._camera = follower, camera

    def update(
        self, frame: Image, motion: Motion | None = None, following: Image | None = None
    ) -> Track:
        """The target in the next frame, in raw-frame pixels.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
            Of the same size as the first one.
        motion : Motion, optional
            The camera's motion to this frame, if it is already known (several targets in one
            video share one estimate); estimated from the frames otherwise.
        following : (H, W, 3) uint8 BGR, optional
            The frame after this one, where it is at hand: the camera's motion to it is estimated
            while the tracker runs, in a thread of this tracker's own. It must be the next one that
            is given, and not be written to until then. Changes no result.

        Raises
        ------
        ValueError
            There is no target yet, or the frame is not an image or not the one that was
            announced, or `following` or `motion` is not of its form.
        FrameSizeError
            The frame's size is not that of the first one.
        """
        if self._box is None:
            raise ArgumentError("no target yet: call init(frame, box) before update(frame)")
        check_frame(frame, self._size_wh)
        # One of another size is refused in its turn.
        ahead = following is not None and check_frame(following) == self._size_wh
        known = None if motion is None else as_motion(motion, self._size_wh)
        if self._camera is not None:
            known = self._camera.update(frame, self._box, known)
        expected = self.expect(known)
        if self._camera is not None and ahead and following is not None and expected is not None:
            self._camera.start(following, expected)
        return self.look(frame)

    def expect(self, motion: Motion | None) -> XYWH | None:
        """The first half of an update: where the target will be, if that can be told."""
        self._expected = self._follower.expect(motion)
        return self._expected

    def look(self, frame: Image) -> Track:
        """The second half of an update: where the target is."""
        check_frame(frame, self._size_wh)
        if self._sight.shows(frame, self._follower.sought_xywh, lost=self._watch.lost):
            track = self._looked(frame)
        else:
            track = self._follower.hold()
        if track.lost:
            track = replace(track, box=_beside(track.box, self._size_wh))
        self._seen = track.box
        self._box = self._expected or track.box
        return track

    def _looked(self, frame: Image) -> Track:
        """What is seen in a frame that shows something.

        Where neither the camera's motion nor the target is found in it (noise, a torn picture,
        another scene), it is taken for one that shows nothing, and what was done with it undone.
        OpenCV's trackers, which cannot be copied, keep what they have made of it.
        """
        before = None
        if self._follower.is_blind:
            with suppress(CopyError):
                before = copy.deepcopy((self._follower, self._tracker, self._watch))
        track = self._follower.look(frame)
        if before is None or track.score > _FLAT:
            return track
        self._follower, self._tracker, self._watch = before
        return self._follower.hold()

    def _started(
        self, config: StabilizerConfig, frame: Image, xywh: XYWH, watch: Watch
    ) -> tuple[Pursuit | Steadying, PrefetchingCameraMotion | None]:
        """What follows the target in `xywh` of `frame`, and a camera that has seen the frame."""
        make = Pursuit if config.stabilize == "predict" else Steadying
        follower, camera = make(self._tracker, config, xywh, watch), _camera(config)
        if camera is not None:
            follower.expect(camera.update(frame))
        return follower, camera


def _camera(config: StabilizerConfig) -> PrefetchingCameraMotion | None:
    if config.stabilize == "off":
        return None
    return PrefetchingCameraMotion(CameraMotion(config.keypoints, config.fit, model="rigid"))


def _unsteadied(frame: Image, config: StabilizerConfig) -> FrameView:
    return FrameView(frame, border=0 if config.stabilize == "off" else config.border)


def _beside(xywh: XYWH, size_wh: tuple[int, int]) -> XYWH:
    """The box, moved to where it touches the frame of (width, height) if it is off it."""
    x, y, w, h = xywh
    width, height = size_wh
    return min(max(x, -w), float(width)), min(max(y, -h), float(height)), w, h
