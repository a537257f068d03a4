"""`Watch`: whether the target is lost. `Whereabouts`: where it can be then."""

from __future__ import annotations

import math
from typing import Final

from ssiam.geometry import XYWH, map_box
from ssiam.motion import Motion

_MEMORY: Final = 0.65  # weight of the past in the running score
_LOST: Final = 0.2  # running score below which the target is lost
_FOUND: Final = 0.35  # and above which it is found again
_UNSEEN: Final = 0.35  # the same two numbers where frames showed nothing: what is seen after them
_SURELY: Final = 0.6  # may be something else, and has to be sure
_EASIER: Final = 0.004  # by which that falls in each frame, until it is `_FOUND` again

# How far a target may be from where it was seen last, target sizes.
_PLAY: Final = 0.7  # when it was hidden for a moment
_DRIFT: Final = 0.015  # and for each frame of it
_GROWTH: Final = 3.0  # that a size changed to the double, or by half, counts for


class Watch:
    """Hysteresis on a running mean of the score: one bad frame loses nothing.

    Attributes
    ----------
    lost : bool
    frames : int
        For how many frames the target has been lost.
    """

    def __init__(self) -> None:
        self.lost = False
        self.frames = 0
        self._running = 1.0
        self._found = _FOUND

    def update(self, score: float) -> None:
        """Take the score 0..1 of one more frame."""
        self._running = _MEMORY * self._running + (1 - _MEMORY) * score
        self._found = max(self._found - _EASIER, _FOUND)
        if self.lost:
            self.frames += 1
            if self._running > self._found:
                self.lost, self.frames = False, 0
        elif self._running < _LOST:
            self.lost = True

    def wait(self) -> None:
        """A frame shows nothing: the target is not seen, and nobody can look for it."""
        self._running *= _MEMORY
        if self._running < _UNSEEN:
            self.lost, self._found = True, _SURELY


class Whereabouts:
    """Where a target can be that was out of sight for a moment.

    When something comes between, a tracker slips to what lies beside its target and looks like it,
    and is soon as sure of that as it was before. Nothing but the place tells the two apart: the
    target is still about where it was in the scene or, if the camera is kept on it, in the
    picture, and about as large. While it is in sight its place tells nothing, it may jump.

    Parameters
    ----------
    xywh : (x, y, w, h)
        The target, raw-frame pixels.
    """

    def __init__(self, xywh: XYWH) -> None:
        self._in_scene = self._in_picture = xywh
        self._frames = 0  # since it was seen

    def carry(self, motion: Motion) -> None:
        """Go on to the next frame, reached by `motion`."""
        self._frames += 1
        if motion.reliable:
            self._in_scene = map_box(motion.cur_from_prev, self._in_scene)

    def see(self, xywh: XYWH) -> None:
        """The target seems to be in `xywh`, which is believed where it can be there."""
        if self.explains(xywh):
            self._in_scene = self._in_picture = xywh
            self._frames = 0

    def explains(self, xywh: XYWH) -> bool:
        """Whether the target can be in `xywh`."""
        if self._frames <= 1:
            return True
        apart = min(_apart(xywh, self._in_scene), _apart(xywh, self._in_picture))
        return apart <= _PLAY + _DRIFT * self._frames


def _apart(xywh: XYWH, seen: XYWH) -> float:
    """By how much a box is not the one that was seen, in place or in size; target sizes."""
    (x, y, w, h), (u, v, p, q) = xywh, seen
    away = math.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2) / math.sqrt(p * q)
    return max(away, _GROWTH * abs(math.log2(w * h / (p * q))) / 2)
