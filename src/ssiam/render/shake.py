"""`ShakeMeter`: how much the image of a camera, real or virtual, shakes."""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from ssiam.copying import DeepCopied
from ssiam.geometry import Transform, frame_center, map_point

_WINDOW: Final = 1.0  # s over which a motion counts as intended


class ShakeMeter(DeepCopied):
    """Measures shake: the motion from frame to frame without its mean over a second.

    A steady pan is no shake. Memory does not grow with the stream.

    Threads: one thread at a time.

    Parameters
    ----------
    fps : float
        Frames per second.
    """

    def __init__(self, fps: float) -> None:
        self._half = max(1, round(_WINDOW * fps / 2))
        self._steps: deque[tuple[float, float]] = deque(maxlen=2 * self._half + 1)
        self._total, self._count = 0.0, 0

    def add(self, cur_from_prev: Transform, size_wh: tuple[int, int]) -> None:
        """Add the motion of an image of `size_wh` (width, height) pixels since the last one."""
        x, y = frame_center(size_wh)
        moved_x, moved_y = map_point(cur_from_prev, x, y)
        self._steps.append((moved_x - x, moved_y - y))
        if len(self._steps) == self._steps.maxlen:
            self._measure(self._half)

    def _measure(self, index: int) -> None:
        steps = np.array(self._steps)
        self._total += float(np.hypot(*(steps[index] - steps.mean(axis=0))))
        self._count += 1

    @property
    def px_per_frame(self) -> float:
        """Mean distance of a frame's motion from the mean of the second around it, pixels.

        For less than a second, from the mean of all.
        """
        if self._count:
            return self._total / self._count
        if not self._steps:
            return 0.0
        steps = np.array(self._steps)
        return float(np.hypot(*(steps - steps.mean(axis=0)).T).mean())
