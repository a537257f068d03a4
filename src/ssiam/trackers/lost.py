"""`LossDetector` decides whether the target is lost; `ReachableBox`, which boxes it can have."""

from __future__ import annotations

import math
from typing import Final

from ssiam.geometry import XYWH, center_distance
from ssiam.motion import Motion

_MEMORY: Final = 0.65  # weight of the past in the running score
_LOST_BELOW: Final = 0.2  # running score below which the target is lost
_FOUND_ABOVE: Final = 0.35  # running score above which it is re-detected
# After blank frames the tracker may be on another object: the target is lost earlier, and the
# threshold of re-detection is higher at first and falls to `_FOUND_ABOVE`.
_LOST_BELOW_BLANK: Final = 0.35
_FOUND_ABOVE_BLANK: Final = 0.6
_FOUND_DECAY: Final = 0.004  # per frame

# Tolerance of `ReachableBox`, target sizes.
_TOLERANCE: Final = 0.7  # for a target that was occluded for a moment
_DRIFT: Final = 0.015  # added per frame without the target
_MAX_TOLERANCE: Final = 2.0  # with all that is added
_SIZE_WEIGHT: Final = 3.0  # distance equivalent to a change of the size by a factor of 2


class LossDetector:
    """Hysteresis on a running mean of the score: a single low score does not lose the target.

    Attributes
    ----------
    lost : bool
        Whether the target is lost.
    frames_lost : int
        Number of frames since it was lost; 0 while it is tracked.
    """

    def __init__(self) -> None:
        self.lost = False
        self.frames_lost = 0
        self._running = 1.0
        self._found_above = _FOUND_ABOVE

    def update(self, score: float) -> None:
        """Add the score (0..1) of one frame."""
        self._running = _MEMORY * self._running + (1 - _MEMORY) * score
        self._found_above = max(self._found_above - _FOUND_DECAY, _FOUND_ABOVE)
        if self.lost:
            self.frames_lost += 1
            if self._running > self._found_above:
                self.lost, self.frames_lost = False, 0
        elif self._running < _LOST_BELOW:
            self.lost = True

    def doubt(self) -> None:
        """Raise the threshold of re-detection for some time, as after blank frames."""
        self._found_above = _FOUND_ABOVE_BLANK

    def confirm(self) -> None:
        """Re-detect the target, which was recognized by other evidence than its score."""
        if self.lost:
            self.lost, self.frames_lost = False, 0
            self._running = max(self._running, self._found_above)

    def skip_blank(self) -> None:
        """Add a blank frame, in which the target cannot be visible."""
        self._running *= _MEMORY
        if self._running < _LOST_BELOW_BLANK:
            self.lost, self._found_above = True, _FOUND_ABOVE_BLANK


class ReachableBox:
    """The boxes that a target can have after a short occlusion.

    When the target is occluded, a tracker often switches to a distractor next to it and soon
    reports a high score again. Only the position distinguishes the two: the target is still close
    to its last position in the scene or, if the camera follows it, in the frame, and has about
    the same size. While the target is visible every box is accepted, because it may jump.

    Parameters
    ----------
    xywh : (x, y, w, h)
        Box of the target, raw-frame pixels.

    Attributes
    ----------
    frames_unseen : int
        Frames since the target's last box.
    """

    def __init__(self, xywh: XYWH) -> None:
        self._scene_xywh = self._frame_xywh = xywh  # moves with the scene, stays in the frame
        self.frames_unseen = 0

    def advance(self, motion: Motion) -> None:
        """Move on to the next frame, reached by `motion`."""
        self.frames_unseen += 1
        if motion.reliable:
            self._scene_xywh = motion.map_box(self._scene_xywh)

    def observe(self, xywh: XYWH) -> None:
        """Take `xywh` as the target's box in this frame, if it is reachable."""
        if self.contains(xywh):
            self.take(xywh)

    def take(self, xywh: XYWH) -> None:
        """Take `xywh` as the target's box in this frame."""
        self._scene_xywh = self._frame_xywh = xywh
        self.frames_unseen = 0

    def move_to(self, xywh: XYWH) -> None:
        """Assume that the unseen target is in `xywh` now."""
        self._scene_xywh = self._frame_xywh = xywh

    def contains(self, xywh: XYWH) -> bool:
        """Whether the target is likely to have the box `xywh` in this frame."""
        if self.frames_unseen <= 1:
            return True
        distance = min(_distance(xywh, self._scene_xywh), _distance(xywh, self._frame_xywh))
        return distance <= min(_TOLERANCE + _DRIFT * self.frames_unseen, _MAX_TOLERANCE)


def _distance(xywh: XYWH, last_xywh: XYWH) -> float:
    """The larger of two boxes' differences in position and in size, in target sizes."""
    (_, _, w, h), (_, _, p, q) = xywh, last_xywh
    octaves = abs(math.log2(w * h / (p * q))) / 2
    return max(center_distance(xywh, last_xywh), _SIZE_WEIGHT * octaves)
