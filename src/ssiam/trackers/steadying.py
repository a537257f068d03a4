"""`Steadying`: a tracker on frames that are steadied as the paper does it, or not at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ssiam.geometry import IDENTITY, XYWH, Image, Transform, map_box
from ssiam.motion import Motion
from ssiam.stabilize import FrameView, Stabilizer, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.base import ViewTracker
from ssiam.trackers.watch import Watch


class Steadying:
    """Follows one target with a `ViewTracker` on the views of a `Stabilizer`.

    Parameters
    ----------
    tracker : ViewTracker
        Knows its target, and where it is.
    config : StabilizerConfig
    xywh : (x, y, w, h)
        There, raw-frame pixels; the tracker alone goes on from it.
    watch : Watch
        Whether it is lost.
    """

    def __init__(
        self, tracker: ViewTracker, config: StabilizerConfig, xywh: XYWH, watch: Watch
    ) -> None:
        self._tracker = tracker
        self._stabilizer = Stabilizer(config)
        self._border = 0 if config.stabilize == "off" else config.border
        self._watch = watch
        self._xywh = xywh  # where the tracker looks, steadied pixels

    def expect(self, motion: Motion | None) -> XYWH | None:
        """Take the motion to the next frame; where the target will be is not known."""
        self._motion = motion
        self._stab_from_raw: Transform = (
            IDENTITY if motion is None else self._stabilizer.update(motion)
        )
        return None

    @property
    def is_blind(self) -> bool:
        """Whether the camera's motion to that frame is not known."""
        return self._motion is not None and not self._motion.reliable

    @property
    def sought_xywh(self) -> XYWH:
        """The box in that frame around which the tracker looks, raw-frame pixels."""
        return map_box(np.asarray(np.linalg.inv(self._stab_from_raw)), self._xywh)

    def hold(self) -> Track:
        """The target in that frame, which shows nothing: the tracker is not asked."""
        self._watch.wait()
        track = Track(self.sought_xywh, 0.0, self._watch.lost)
        if self._motion is None:
            return track
        return replace(track, motion=self._motion, stab_from_raw=self._stab_from_raw)

    def look(self, frame: Image) -> Track:
        """The target in that frame, raw-frame pixels."""
        view = FrameView(frame, self._stab_from_raw, self._border)
        track = self._tracker.track(view)
        self._xywh = track.box
        self._watch.update(track.score)
        if self._motion is None:
            return replace(track, lost=self._watch.lost)
        return replace(
            track.mapped(view.raw_from_stab, view.size_wh),
            lost=self._watch.lost,
            motion=self._motion,
            stab_from_raw=self._stab_from_raw,
        )
