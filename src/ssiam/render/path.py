"""`ScenePath`: where the camera was in the scene, in each frame of a clip."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Transform, frame_center, local_zoom, rigid_parameters
from ssiam.motion import Motion

Poses = NDArray[np.float64]
"""(..., 4): x and y of the frame center (pixels), angle (radians) and logarithm of the zoom."""


class ScenePath:
    """The poses of a camera in the scene: the pixels of its first frame.

    A motion is reduced to a similarity at the frame center. The shift, the angle and the zoom are
    added up, not the matrices, so precision does not depend on the length of the clip. Motions
    that are not reliable are interpolated between the reliable ones before and after them: the
    camera of a blurred frame usually moves on.

    Threads: a value; any number of threads may share it.

    Parameters
    ----------
    motions : sequence of Motion
        Of each frame; that of the first frame is not used.
    size_wh : (int, int)
        Width and height of the frames, pixels.

    Attributes
    ----------
    poses : (N, 4) float64
        Of each frame: position of its center in the scene, angle and log zoom.
    size_wh : (int, int)
    """

    def __init__(self, motions: Sequence[Motion], size_wh: tuple[int, int]) -> None:
        self.size_wh = size_wh
        steps = _interpolated_steps(motions)
        self.poses = np.zeros_like(steps)
        self.poses[:, 2:] = np.cumsum(steps[:, 2:], axis=0)
        before = np.vstack([np.zeros((1, 2)), self.poses[:-1, 2:]])[: len(steps)]
        turned = steps[:, :2] @ np.array([1, 1j]) * np.exp(1j * before[:, 0] + before[:, 1])
        center = frame_center(size_wh)
        self.poses[:, 0] = center[0] + np.cumsum(turned.real)
        self.poses[:, 1] = center[1] + np.cumsum(turned.imag)

    def __len__(self) -> int:
        return len(self.poses)

    def scene_from_raw(self) -> Transform:
        """Maps raw pixels of each frame to the scene, (N, 3, 3)."""
        return scene_from_view(self.poses, self.size_wh)


def _interpolated_steps(motions: Sequence[Motion]) -> NDArray[np.float64]:
    """Steps (N, 4) of the camera to each frame; that to the first one is 0."""
    steps = np.zeros((len(motions), 4))
    known = [index for index, motion in enumerate(motions) if index and motion.reliable]
    if not known:
        return steps
    steps[known] = [_camera_step(motions[index]) for index in known]
    for column in steps.T:
        column[1:] = np.interp(np.arange(1, len(motions)), known, column[known])
    return steps


def _camera_step(motion: Motion) -> Poses:
    """How the camera moved (4,): its shift is in pixels of the earlier frame."""
    prev_from_cur = np.asarray(np.linalg.inv(motion.cur_from_prev), dtype=np.float64)
    return pose_of(prev_from_cur, motion.size_wh)


def pose_of(to_from_from: Transform, size_wh: tuple[int, int]) -> Poses:
    """A transform as a pose (4,): shift (pixels), angle and log zoom at the center of an image.

    `size_wh` is the width and height of the image, pixels.
    """
    center = frame_center(size_wh)
    dx, dy, angle = rigid_parameters(to_from_from, center)
    return np.array([dx, dy, angle, math.log(local_zoom(to_from_from, center))])


def scene_from_view(poses: Poses, size_wh: tuple[int, int]) -> Transform:
    """Maps pixels of cameras at `poses` (..., 4) to the scene, (..., 3, 3).

    `size_wh` is the width and height of the cameras' images, pixels.
    """
    turned = np.exp(poses[..., 3] + 1j * poses[..., 2])
    x, y = frame_center(size_wh)
    offset = turned * complex(x, y)
    matrices = np.zeros((*poses.shape[:-1], 3, 3))
    matrices[..., 0, 0] = matrices[..., 1, 1] = turned.real
    matrices[..., 1, 0], matrices[..., 0, 1] = turned.imag, -turned.imag
    matrices[..., 0, 2] = poses[..., 0] - offset.real
    matrices[..., 1, 2] = poses[..., 1] - offset.imag
    matrices[..., 2, 2] = 1
    return matrices


def held_from_moved(pose: Poses, size_wh: tuple[int, int]) -> Transform:
    """Maps pixels of a camera that has moved by `pose` (4,) to those before it moved, (3, 3).

    The shift is that of the center of the image of `size_wh` (width, height) pixels.
    """
    return scene_from_view(pose + np.array([*frame_center(size_wh), 0.0, 0.0]), size_wh)
