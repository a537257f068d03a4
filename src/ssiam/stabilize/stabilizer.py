"""`Stabilizer`: from the camera's motion to the transform that steadies the frame (eq. 5-7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import IDENTITY, Transform, frame_centre, rigid
from ssiam.motion import Motion
from ssiam.stabilize.config import StabilizerConfig
from ssiam.stabilize.path import CameraPath


class Stabilizer:
    """Turns camera motions into ``stab_from_raw``, one frame at a time, without delay.

    Parameters
    ----------
    config : StabilizerConfig
    """

    def __init__(self, config: StabilizerConfig) -> None:
        self._config = config
        self._path = CameraPath(config.window)
        self._shift = np.zeros(2)  # dx', dy' of the previous frame
        self._stab_from_raw: Transform = IDENTITY

    def update(self, motion: Motion) -> Transform:
        """M_t of eq. 7: takes raw-frame pixels to the steadied frame, (3, 3) float64.

        The frame's border is not part of it. Where the motion is not reliable, the view of the
        frame before is held and the path waits: a wrong motion would throw the target out of
        the search region.
        """
        if self._config.stabilize == "off" or not motion.reliable:
            return self._stab_from_raw
        self._path.advance(motion)
        dx, dy, angle = self._limited(self._wanted(motion), motion.size_wh)
        self._stab_from_raw = rigid(dx, dy, angle, frame_centre(motion.size_wh))
        return self._stab_from_raw

    def _wanted(self, motion: Motion) -> NDArray[np.float64]:
        """(dx, dy, da) that puts the frame onto the smoothed path (eq. 5)."""
        difference = self._path.difference()
        if self._config.stabilize == "literal":
            return difference + motion.shift_angle  # eq. 5 as printed: trans + difference
        return difference

    def _limited(
        self, new_trans: NDArray[np.float64], size_wh: tuple[int, int]
    ) -> tuple[float, float, float]:
        """The limits of eq. 6, with the signs that its print has lost."""
        config = self._config
        if _largest_move(new_trans, size_wh) < config.gate:
            new_trans = np.zeros(3)
        most = config.border + np.array([config.thx1, config.thy1])
        shift = np.clip(new_trans[:2], -most, most)
        step = np.array([config.thx2, config.thy2])
        self._shift = np.clip(shift, self._shift - step, self._shift + step)
        angle = np.clip(new_trans[2], -config.tha, config.tha)
        return float(self._shift[0]), float(self._shift[1]), float(angle)


def _largest_move(new_trans: NDArray[np.float64], size_wh: tuple[int, int]) -> float:
    """How far a steadying moves any pixel, at the most; the judge of Fig. 2 knows only x and y."""
    dx, dy, angle = new_trans
    return float(np.hypot(dx, dy) + abs(angle) * np.hypot(*size_wh) / 2)
