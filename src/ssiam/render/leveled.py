"""`LeveledPath`: the scene's coordinates, in which the recording camera's roll is removed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ssiam.geometry import Transform, frame_center
from ssiam.motion import Motion
from ssiam.render.banded import BandedLeastSquares, Floats
from ssiam.render.path import Poses, pose_of, scene_from_view


@dataclass(frozen=True, eq=False)
class LeveledPath:
    """The path of the recording camera through the scene.

    Scene coordinates are pixels of the frames, moved by the camera's shift. Roll and zoom that last
    longer than some seconds are not removed: they would add up to drift of the horizon and of the
    unit over a long clip.

    Attributes
    ----------
    origin_xy : (N, 2) float64
        Frame center of each frame in scene coordinates, pixels.
    roll : (N,) float64
        Turn of the scene in the frame, radians.
    log_zoom : (N,) float64
        Logarithm of the size of the scene in the frame.
    size_wh : (int, int)
        Width and height of the frames, pixels.
    """

    origin_xy: Floats
    roll: Floats
    log_zoom: Floats
    size_wh: tuple[int, int]

    def scene_from_raw(self) -> Transform:
        """Maps pixels of each frame to scene coordinates: (N, 3, 3)."""
        poses = np.column_stack([self.origin_xy, -self.roll, -self.log_zoom])
        return scene_from_view(poses, self.size_wh)


def camera_steps(motion: Motion) -> Poses:
    """(dx, dy, angle, log zoom) of a motion, at the frame center: pixels and radians.

    They are 0 if the motion is not reliable.
    """
    return pose_of(motion.cur_from_prev, motion.size_wh) if motion.reliable else np.zeros(4)


def leveled_path(motions: Sequence[Motion], window: float) -> LeveledPath:
    """The path of the recording camera.

    Parameters
    ----------
    motions : sequence of Motion
        One for each frame, at least one; that of the first frame is not used.
    window : float
        Frames; roll and zoom of longer periods are kept.
    """
    steps = np.array([camera_steps(each) for each in motions])
    steps[0] = 0
    turned = np.cumsum(steps[:, 2:], axis=0)
    roll, log_zoom = (turned - _slow(turned, window)).T
    cos, sin, shrink = np.cos(roll), np.sin(roll), np.exp(-log_zoom)
    dx, dy = steps[:, 0], steps[:, 1]
    shifts = np.stack([cos * dx + sin * dy, cos * dy - sin * dx], axis=1) * shrink[:, None]
    size_wh = motions[0].size_wh
    return LeveledPath(frame_center(size_wh) - np.cumsum(shifts, axis=0), roll, log_zoom, size_wh)


def _slow(values: Floats, window: float) -> Floats:
    """The part of values (N, channels) whose periods are longer than `window` frames."""
    problem = BandedLeastSquares(len(values), values.shape[1], max_order=2)
    problem.add_difference(0, 1.0, values)
    problem.add_difference(2, smoothness(window, 2))
    return problem.solve()


def smoothness(period: float, order: int) -> float:
    """Weight of squared differences at which a vibration of `period` frames keeps half its size."""
    return float((2 * math.sin(math.pi / max(period, 2.0))) ** (-2 * order))
