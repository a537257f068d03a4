"""`Stabilizer`: from the camera motion to the transform that stabilizes the frame (eq. 5-7)."""

from __future__ import annotations

import math

import numpy as np

from ssiam.copying import DeepCopied
from ssiam.errors import ArgumentError
from ssiam.geometry import IDENTITY, Transform, frame_center, rigid, short_repr
from ssiam.motion import Motion
from ssiam.motion.motion import as_motion
from ssiam.stabilize.config import StabilizerConfig
from ssiam.stabilize.judge import ShakeJudge


class Stabilizer(DeepCopied):
    """Computes ``stab_from_raw`` from camera motions, one frame at a time, without delay.

    Threads: one thread at a time for each object; several objects are independent.

    Parameters
    ----------
    config : StabilizerConfig
        With the method "paper", "literal" or "off"; "predict" is treated as "paper" here, because
        it needs the target (`TargetPredictor`).

    Raises
    ------
    ArgumentError
        `config` is not a `StabilizerConfig`.
    """

    def __init__(self, config: StabilizerConfig) -> None:
        if not isinstance(config, StabilizerConfig):
            raise ArgumentError(f"config is {short_repr(config)}: give a StabilizerConfig")
        self._config = config
        self._path = CameraPath(config.paper.window)
        self._judge = ShakeJudge(config.paper)
        self._last = (0.0, 0.0, 0.0)  # dx', dy', da' of the previous frame
        self._stab_from_raw: Transform = IDENTITY

    def __repr__(self) -> str:
        return f"Stabilizer({self._config!r})"

    def update(self, motion: Motion) -> Transform:
        """M_t of eq. 7, (3, 3) float64: maps raw-frame pixels to stabilized pixels.

        The border of `FrameView` is not included. If the motion is not reliable, the previous view
        is returned and the path is not changed: a wrong motion would move the target out of the
        search region.

        Raises
        ------
        ArgumentError
            `motion` is not a `Motion`, or one that no camera can make: with NaN, or out of all
            bounds.
        """
        if not isinstance(motion, Motion):
            raise ArgumentError(f"motion is {short_repr(motion)}: give a Motion")
        if self._config.stabilize == "off" or not motion.reliable:
            return self._stab_from_raw
        as_motion(motion, motion.size_wh)
        self._path.advance(motion)
        dx, dy, angle = self._limited(self._correction(motion), motion.size_wh)
        self._stab_from_raw = rigid(dx, dy, angle, frame_center(motion.size_wh))
        return self._stab_from_raw

    @property
    def shakes(self) -> bool:
        """Whether the judge found that the last frame needs stabilization (Table 4)."""
        return self._judge.answer

    def _correction(self, motion: Motion) -> tuple[float, float, float]:
        """(dx, dy, da) that moves the frame onto the smoothed path (eq. 5)."""
        dx, dy, angle = self._path.difference()
        if self._config.stabilize == "literal":  # eq. 5 as printed: trans + difference
            trans_x, trans_y, trans_a = motion.shift_angle
            return dx + trans_x, dy + trans_y, angle + trans_a
        return dx, dy, angle

    def _limited(
        self, new_trans: tuple[float, float, float], size_wh: tuple[int, int]
    ) -> tuple[float, float, float]:
        """Apply the limits of eq. 6, with the signs that are missing in the printed form."""
        config = self._config.paper
        n = config.border
        if not self._judge.shakes(new_trans, self._path.difference(), size_wh):
            new_trans = (0.0, 0.0, 0.0)
        limited = _nested if config.limits == "nested" else _exclusive
        dx, dy, angle = new_trans
        prev_dx, prev_dy, prev_angle = self._last
        dx = limited(dx, n + config.thx1, prev_dx, config.thx2)
        dy = limited(dy, n + config.thy1, prev_dy, config.thy2)
        middle = 0.0 if config.tha_limits == "angle" else prev_angle
        self._last = dx, dy, _clamped(angle, middle, config.tha_rad)
        return self._last


class CameraPath(DeepCopied):
    """The camera path over the last frames, and its moving average (Fig. 3).

    Threads: one thread at a time for each object; several objects are independent.

    The paper sums (dx, dy, da) over the whole video and averages the sums. Here the poses of the
    last `window` frames are kept relative to the current frame, as composed transforms: the result
    is exact under rotation, and precision and memory do not depend on the length of the stream.

    Parameters
    ----------
    window : int
        Frames that are averaged, the current one included.
    """

    def __init__(self, window: int) -> None:
        self._window = window
        self._past_from_cur = np.empty((0, 3, 3))
        self._center = (0.0, 0.0, 1.0)

    def advance(self, motion: Motion) -> None:
        """Append the pose of the current frame, reached by `motion` from the one before."""
        prev_from_cur = np.linalg.inv(motion.cur_from_prev)
        past_from_cur = self._past_from_cur @ prev_from_cur
        self._past_from_cur = np.concatenate([past_from_cur, np.eye(3)[None]])[-self._window :]
        self._center = (*frame_center(motion.size_wh), 1.0)

    @property
    def started(self) -> bool:
        """Whether the path has a pose."""
        return len(self._past_from_cur) > 0

    def difference(self) -> tuple[float, float, float]:
        """Smoothed minus actual path at the current frame: dx, dy in pixels, da in radians.

        A background point at p in the current frame was at ``past_from_cur @ p`` in the past
        frames; the mean of these is its position on the smoothed path. The shift is that of the
        frame center; (0, 0, 0) for an empty path.
        """
        if not self.started:
            return 0.0, 0.0, 0.0
        poses = self._past_from_cur
        past_centers = poses @ self._center
        mean_x, mean_y = (past_centers[:, :2] / past_centers[:, 2:]).mean(axis=0).tolist()
        angle = float(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]).mean())
        return mean_x - self._center[0], mean_y - self._center[1], angle


def _clamped(value: float, middle: float, reach: float) -> float:
    """The number nearest to `value` that is at most `reach` away from `middle`."""
    return min(max(value, middle - reach), middle + reach)


def _nested(value: float, limit: float, prev: float, change: float) -> float:
    """Both cases of eq. 6: at most `limit` from 0, and then at most `change` from `prev`."""
    return _clamped(_clamped(value, 0.0, limit), prev, change)


def _exclusive(value: float, limit: float, prev: float, change: float) -> float:
    """The first case of eq. 6 that holds."""
    if abs(value) > limit:
        return math.copysign(limit, value)
    return _clamped(value, prev, change)
