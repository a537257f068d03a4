"""`Watch`: whether the target is lost."""

from __future__ import annotations

from typing import Final

_MEMORY: Final = 0.65  # weight of the past in the running score
_LOST: Final = 0.2  # running score below which the target is lost
_FOUND: Final = 0.35  # and above which it is found again


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

    def update(self, score: float) -> None:
        """Take the score 0..1 of one more frame."""
        self._running = _MEMORY * self._running + (1 - _MEMORY) * score
        if self.lost:
            self.frames += 1
            if self._running > _FOUND:
                self.lost, self.frames = False, 0
        elif self._running < _LOST:
            self.lost = True
