"""`Stabilizer`: from the camera's motion to the transform that steadies the frame (eq. 5-7)."""

from __future__ import annotations

import math

import numpy as np

from ssiam.copying import DeepCopied
from ssiam.errors import ArgumentError
from ssiam.geometry import IDENTITY, Transform, frame_center, rigid, short_repr
from ssiam.motion import Motion
from ssiam.stabilize.config import StabilizerConfig


class CameraPath(DeepCopied):
    """The poses of the last `window` frames, the current one included.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    The paper sums (dx, dy, da) for ever and averages the sums. Here every pose is kept relative to
    the current frame, by composing whole transforms: a turning camera does not bend the path, a
    stream that runs for days loses no precision, and memory is `window` transforms.
    """

    def __init__(self, window: int) -> None:
        self._window = window
        self._past_from_cur = np.empty((0, 3, 3))
        self._centre = (0.0, 0.0, 1.0)

    def advance(self, motion: Motion) -> None:
        """Append the pose of the current frame, reached by `motion` from the one before."""
        prev_from_cur = np.linalg.inv(motion.cur_from_prev)
        past_from_cur = self._past_from_cur @ prev_from_cur
        self._past_from_cur = np.concatenate([past_from_cur, np.eye(3)[None]])[-self._window :]
        self._centre = (*frame_center(motion.size_wh), 1.0)

    @property
    def started(self) -> bool:
        """Whether there is a pose yet."""
        return len(self._past_from_cur) > 0

    def difference(self) -> tuple[float, float, float]:
        """Smoothed minus actual path at the current frame: dx, dy in pixels, da in radians.

        A background point now at p was at ``past_from_cur @ p`` in the past frames; the mean of
        these is where it lies on the smoothed path. Taken at the image centre.
        """
        poses = self._past_from_cur
        past_centres = poses @ self._centre
        mean_x, mean_y = (past_centres[:, :2] / past_centres[:, 2:]).mean(axis=0).tolist()
        angle = float(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]).mean())
        return mean_x - self._centre[0], mean_y - self._centre[1], angle


class Stabilizer(DeepCopied):
    """Turns camera motions into ``stab_from_raw``, one frame at a time, without delay.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    config : StabilizerConfig
    """

    def __init__(self, config: StabilizerConfig) -> None:
        if not isinstance(config, StabilizerConfig):
            raise ArgumentError(f"config is {short_repr(config)}: give a StabilizerConfig")
        self._config = config
        self._path = CameraPath(config.paper.window)
        self._shift = (0.0, 0.0)  # dx', dy' of the previous frame
        self._stab_from_raw: Transform = IDENTITY

    def update(self, motion: Motion) -> Transform:
        """M_t of eq. 7: takes raw-frame pixels to the steadied frame, (3, 3) float64.

        The frame's border is not part of it. Where the motion is not reliable, the view of the
        frame before is held and the path waits: a wrong motion would throw the target out of
        the search region.

        Raises
        ------
        ValueError
            It is no `Motion`.
        """
        if not isinstance(motion, Motion):
            raise ArgumentError(f"motion is {short_repr(motion)}: give a Motion")
        if self._config.stabilize == "off" or not motion.reliable:
            return self._stab_from_raw
        self._path.advance(motion)
        dx, dy, angle = self._limited(self._wanted(motion), motion.size_wh)
        self._stab_from_raw = rigid(dx, dy, angle, frame_center(motion.size_wh))
        return self._stab_from_raw

    def _wanted(self, motion: Motion) -> tuple[float, float, float]:
        """(dx, dy, da) that puts the frame onto the smoothed path (eq. 5)."""
        dx, dy, angle = self._path.difference()
        if self._config.stabilize == "literal":  # eq. 5 as printed: trans + difference
            trans_x, trans_y, trans_a = motion.shift_angle
            return dx + trans_x, dy + trans_y, angle + trans_a
        return dx, dy, angle

    def _limited(
        self, new_trans: tuple[float, float, float], size_wh: tuple[int, int]
    ) -> tuple[float, float, float]:
        """The limits of eq. 6, with the signs that its print has lost."""
        n, c = self._config.border, self._config.paper
        if _largest_move(new_trans, size_wh) < c.gate:
            new_trans = (0.0, 0.0, 0.0)
        dx, dy, angle = new_trans
        prev_dx, prev_dy = self._shift
        dx = _within(_within(dx, 0.0, n + c.thx1), prev_dx, c.thx2)
        dy = _within(_within(dy, 0.0, n + c.thy1), prev_dy, c.thy2)
        self._shift = dx, dy
        return dx, dy, _within(angle, 0.0, c.tha)


def _within(value: float, middle: float, reach: float) -> float:
    """The number nearest to `value` that is at most `reach` away from `middle`."""
    return min(max(value, middle - reach), middle + reach)


def _largest_move(new_trans: tuple[float, float, float], size_wh: tuple[int, int]) -> float:
    """How far a steadying moves any pixel, at the most; the judge of Fig. 2 knows only x and y."""
    dx, dy, angle = new_trans
    return math.hypot(dx, dy) + abs(angle) * math.hypot(*size_wh) / 2
