"""`SteadiedTracker`: camera motion, steadying, any tracker, and the way back (Fig. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, Image, check_box, check_frame
from ssiam.motion import CameraMotion, Motion, MotionAhead
from ssiam.stabilize import FrameView, StabilizerConfig
from ssiam.trackers.base import ViewTracker
from ssiam.trackers.pursuit import Pursuit
from ssiam.trackers.sight import Sight
from ssiam.trackers.steadying import Steadying
from ssiam.trackers.track import Track
from ssiam.trackers.watch import Watch


class SteadiedTracker:
    """A tracker that works on the steadied view of each frame and answers in raw pixels.

    Made by `load_tracker`. One object follows one target; `another` gives one for a second
    target, which shares the networks and nothing else.

    Parameters
    ----------
    tracker : ViewTracker
    config : StabilizerConfig
    """

    def __init__(self, tracker: ViewTracker, config: StabilizerConfig) -> None:
        self._tracker = tracker
        self._config = config
        self._box: XYWH | None = None

    @property
    def config(self) -> StabilizerConfig:
        """How this tracker steadies its frames."""
        return self._config

    def camera(self) -> MotionAhead | None:
        """A fresh motion estimator of this tracker's settings, None with stabilize="off"."""
        config = self._config
        if config.stabilize == "off":
            return None
        return MotionAhead(CameraMotion(config.keypoints, config.fit, model="rigid"))

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
        self._size_wh = check_frame(frame)
        self._box = self._seen = check_box(box, self._size_wh)
        self._watch = Watch()
        self._sight = Sight(frame)
        self._tracker.init(self._unsteadied(frame), self._box)
        self._begin(frame)

    def switch(self, config: StabilizerConfig, frame: Image) -> None:
        """Steady by `config` from now on, and keep the target.

        Its template is kept too, where the tracker can be told where to look.

        Parameters
        ----------
        config : StabilizerConfig
        frame : (H, W, 3) uint8 BGR
            The one that was given last.
        """
        self._config = config
        if self._box is None:
            return
        view = self._unsteadied(frame)
        if self._tracker.doubt is None:
            self._tracker.init(view, self._seen)
        else:
            self._tracker.seek(view, self._seen)
        self._box = self._seen
        self._begin(frame)

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
            while the tracker runs. It must be the next one that is given. Changes no result.

        Raises
        ------
        ValueError
            The frame is not an image, or there is no target yet, or not the frame that was
            announced.
        FrameSizeError
            The frame's size is not that of the first one.
        """
        if self._box is None:
            raise ArgumentError("no target yet: call init(frame, box) before update(frame)")
        check_frame(frame, self._size_wh)
        if self._camera is not None:
            motion = self._camera.update(frame, self._box, motion)
        expected = self.expect(motion)
        if self._camera is not None and following is not None and expected is not None:
            self._camera.start(following, expected)
        return self.look(frame)

    def expect(self, motion: Motion | None) -> XYWH | None:
        """The first half of an update: where the target will be, if that can be told."""
        self._expected = self._follower.expect(motion)
        return self._expected

    def look(self, frame: Image) -> Track:
        """The second half of an update: where the target is."""
        check_frame(frame, self._size_wh)
        follower = self._follower
        if self._sight.shows(frame, follower.sought_xywh, lost=self._watch.lost):
            track = follower.look(frame)
        else:
            track = follower.hold()
        if track.lost:
            track = replace(track, box=_beside(track.box, self._size_wh))
        self._seen = track.box
        self._box = self._expected or track.box
        return track

    def _begin(self, frame: Image) -> None:
        """Follow the target, with which the tracker begins in `frame`."""
        make = Pursuit if self._config.stabilize == "predict" else Steadying
        self._follower = make(self._tracker, self._config, self._seen, self._watch)
        self._camera = self.camera()
        if self._camera is not None:
            self._follower.expect(self._camera.update(frame))

    def _unsteadied(self, frame: Image) -> FrameView:
        return FrameView(
            frame, border=0 if self._config.stabilize == "off" else self._config.border
        )


def _beside(xywh: XYWH, size_wh: tuple[int, int]) -> XYWH:
    """The box, moved to where it touches the frame of (width, height) if it is off it."""
    x, y, w, h = xywh
    width, height = size_wh
    return min(max(x, -w), float(width)), min(max(y, -h), float(height)), w, h
