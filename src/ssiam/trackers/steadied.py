"""`SteadiedTracker`: camera motion, steadying, any tracker, and the way back (Fig. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, Image, check_box, check_frame
from ssiam.motion import CameraMotion, Motion
from ssiam.stabilize import FrameView, Stabilizer, StabilizerConfig
from ssiam.trackers.base import ViewTracker
from ssiam.trackers.track import Track


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

    def camera(self) -> CameraMotion | None:
        """A fresh motion estimator of this tracker's settings, None with stabilize="off"."""
        if self._config.stabilize == "off":
            return None
        return CameraMotion(self._config.keypoints, self._config.fit, model="rigid")

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
        self._box = check_box(box, self._size_wh)
        self._camera = self.camera()
        self._stabilizer = Stabilizer(self._config)
        if self._camera is not None:
            self._stabilizer.update(self._camera.update(frame))
        self._tracker.init(FrameView(frame, border=self._border), self._box)

    def update(self, frame: Image, motion: Motion | None = None) -> Track:
        """The target in the next frame, in raw-frame pixels.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
            Of the same size as the first one.
        motion : Motion, optional
            The camera's motion to this frame, if it is already known (several targets in one
            video share one estimate); estimated from the frames otherwise.

        Raises
        ------
        ValueError
            The frame is not an image, or there is no target yet.
        FrameSizeError
            The frame's size is not that of the first one.
        """
        if self._box is None:
            raise ArgumentError("no target yet: call init(frame, box) before update(frame)")
        check_frame(frame, self._size_wh)
        if self._camera is None:
            track = self._tracker.track(FrameView(frame))
        else:
            if motion is None:
                motion = self._camera.update(frame, exclude=self._box)
            track = self._steadied(frame, motion)
        self._box = track.box
        return track

    def _steadied(self, frame: Image, motion: Motion) -> Track:
        stab_from_raw = self._stabilizer.update(motion)
        view = FrameView(frame, stab_from_raw, self._border)
        track = self._tracker.track(view).mapped(view.raw_from_stab, self._size_wh)
        return replace(track, motion=motion, stab_from_raw=stab_from_raw)

    @property
    def _border(self) -> int:
        return 0 if self._config.stabilize == "off" else self._config.border
