"""`CameraPath`: the camera's path over the last frames, and its moving average (Fig. 3)."""

from __future__ import annotations

import numpy as np

from ssiam.copying import CopiedWhole
from ssiam.geometry import frame_centre
from ssiam.motion import Motion


class CameraPath(CopiedWhole):
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
        self._centre = (*frame_centre(motion.size_wh), 1.0)

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
