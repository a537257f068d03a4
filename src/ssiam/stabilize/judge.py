"""`ShakeJudge`: whether a frame needs stabilization (threshold judge, Fig. 2; Table 4)."""

from __future__ import annotations

import math
from collections import deque

from ssiam.copying import DeepCopied
from ssiam.stabilize.config import PaperConfig

_ShiftAngle = tuple[float, float, float]  # dx, dy in pixels, da in radians


class ShakeJudge(DeepCopied):
    """Compares the distance of the camera path from the smoothed path with a threshold.

    The paper sets "a threshold that needs to be debuffeted by comparing the sum of square distance
    with the x axis and y axis", without a number. `PaperConfig.judge` has the two readings.

    Threads: one thread at a time for each object; several objects are independent.

    Parameters
    ----------
    config : PaperConfig
    """

    def __init__(self, config: PaperConfig) -> None:
        self._config = config
        self._squares: deque[float] = deque(maxlen=config.window)
        self.answer = False  # the last one

    def shakes(
        self, new_trans: _ShiftAngle, difference: _ShiftAngle, size_wh: tuple[int, int]
    ) -> bool:
        """Whether the next frame needs stabilization.

        Parameters
        ----------
        new_trans : (dx, dy, da)
            Eq. 5, before its limits; the judge "frame" uses it.
        difference : (dx, dy, da)
            Smoothed minus actual path at this frame; the judge "window" uses dx and dy.
        size_wh : (int, int)
            Width and height of the frame, pixels.
        """
        if self._config.judge == "frame":
            self.answer = _max_displacement(new_trans, size_wh) >= self._config.gate
        else:
            dx, dy, _ = difference
            self._squares.append(dx**2 + dy**2)
            rms = math.sqrt(sum(self._squares) / len(self._squares))
            self.answer = rms >= self._config.shake
        return self.answer


def _max_displacement(new_trans: _ShiftAngle, size_wh: tuple[int, int]) -> float:
    """Upper bound of the displacement of all pixels, in pixels."""
    dx, dy, angle = new_trans
    return math.hypot(dx, dy) + abs(angle) * math.hypot(*size_wh) / 2
