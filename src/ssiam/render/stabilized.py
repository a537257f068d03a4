"""The stabilized view: the whole image still, over a whole clip or live without delay."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from ssiam.copying import DeepCopied
from ssiam.errors import FrameSizeError
from ssiam.geometry import IDENTITY, Transform
from ssiam.motion import Motion
from ssiam.render.crop import AUTO_CROP, Crop, cropped, needed_crop
from ssiam.render.path import Poses, ScenePath, held_from_moved, pose_of, scene_from_view
from ssiam.render.view import CameraView

SMOOTHING: Final = 1.0  # s; standard deviation of the Gaussian that smooths about as much
# 1 / (1 + (w s / 1.1685)^4) leaves as much speed of a white shake as a Gaussian of standard
# deviation s does: (sqrt(pi) / 4 / (pi / 8 / sqrt(2)))^(1 / 3).
_CORNER: Final = 1.1685
_PADDING: Final = 3  # standard deviations by which a path is continued at both ends
# Rounds of the search for the smoothest path within the crop, and the weights of the crop in the
# first and the last one. In trials, 300 rounds changed the shake by less than 5 %.
_ROUNDS: Final = 100
_FIRST_WEIGHT: Final = 1.0
_LAST_WEIGHT: Final = 1e5
_FINAL_ROUNDS: Final = 3  # of shrinking corrections: the crop is not exactly proportional to them

# Of the live camera; the best of trials on three shaking clips and a pan that starts and stops.
_LIVE_SMOOTHING: Final = 5.0  # s that it takes to follow the camera
_LIVE_CATCHING_UP: Final = 0.4  # s in which it reaches the camera's speed at the end of the crop
_LIVE_SOFT: Final = 0.8  # share of the crop from which it follows faster
_LIVE_CROP: Final = 0.10  # share of width and height that is cropped without a given share
_LIVE_ROUNDS: Final = 3  # of shrinking a correction: the crop is not exactly proportional to it


def stabilized_views(
    path: ScenePath, fps: float, *, crop: Crop = AUTO_CROP, smoothing: float = SMOOTHING
) -> tuple[list[CameraView], float]:
    """Views of a virtual camera on the smoothest path through a whole clip.

    The position of the frame center in the scene, the angle and the logarithm of the zoom minimize
    the squared distance from the camera's path plus the squared second difference, weighted as
    `smoothing` says (Whittaker 1923), within the allowed crop. A steady pan or zoom is kept.

    Parameters
    ----------
    path : ScenePath
    fps : float
        Frames per second.
    crop : Crop
    smoothing : float
        Standard deviation of the Gaussian filter that smooths as much, seconds.

    Returns
    -------
    views : list of CameraView
        Of each frame, in the frame's size.
    share : float
        Share of width and of height that is cropped.
    """
    size_wh = path.size_wh
    if not len(path):
        return [], 0.0
    poses = _smoothest_within(path.poses, smoothing * fps, crop.budget, size_wh)
    view_from_raw = _view_from_raw(poses, path.poses, size_wh)
    share = crop.chosen(needed_crop(view_from_raw, size_wh))
    out_from_raw = cropped(view_from_raw, share, size_wh)
    return [CameraView(matrix, size_wh) for matrix in out_from_raw], share


def _smoothest_within(
    camera: Poses, sigma: float, budget: float, size_wh: tuple[int, int]
) -> Poses:
    """The smoothest poses (N, 4) near `camera` that need at most the crop `budget`.

    Alternating directions method of multipliers (Boyd et al. 2011), in which the projection onto
    the allowed poses shrinks the correction of each frame.
    """
    reach = min(math.ceil(_PADDING * sigma), len(camera) - 1)
    target = _continued(camera, reach)
    smoother = _Smoother(len(target), sigma)
    poses, dual = smoother.nearest(target), np.zeros_like(target)
    weights = np.geomspace(_FIRST_WEIGHT, _LAST_WEIGHT, _ROUNDS)
    for weight in weights:
        wished = poses + dual
        allowed = _within(wished, target, budget, size_wh)
        if allowed is wished:
            break
        poses = smoother.nearest(target, allowed - (wished - allowed), weight)
        dual = (wished - allowed) * (weights[0] / weights[1])
    for _ in range(_FINAL_ROUNDS):
        poses = _within(poses, target, budget, size_wh)
    return poses[reach : reach + len(camera)]


def _within(poses: Poses, camera: Poses, budget: float, size_wh: tuple[int, int]) -> Poses:
    """The poses, moved toward those of the camera where they need more crop than `budget`."""
    needed = needed_crop(_view_from_raw(poses, camera, size_wh), size_wh)
    if (needed <= budget).all():
        return poses
    share = np.minimum(1, budget / np.maximum(needed, budget))[:, None]
    return np.asarray(camera + share * (poses - camera), dtype=np.float64)


def _view_from_raw(poses: Poses, camera: Poses, size_wh: tuple[int, int]) -> Transform:
    """Maps pixels of the camera at `camera` to pixels of the one at `poses`, (N, 3, 3)."""
    view_from_scene = np.linalg.inv(scene_from_view(poses, size_wh))
    return np.asarray(view_from_scene @ scene_from_view(camera, size_wh), dtype=np.float64)


def _continued(poses: Poses, reach: int) -> Poses:
    """Poses (N, 4), continued by `reach` frames at both ends by their point reflection."""
    before = 2 * poses[0] - poses[reach:0:-1]
    after = 2 * poses[-1] - poses[-2 : -reach - 2 : -1]
    return np.concatenate([before, poses, after])


class _Smoother:
    """Minimizes squared distances plus squared second differences, by the Fourier transform.

    Parameters
    ----------
    count : int
        Number of poses.
    sigma : float
        Frames; a white shake becomes as slow as by a Gaussian of this standard deviation.
    """

    def __init__(self, count: int, sigma: float) -> None:
        angles = np.arange(count + 1) * np.pi / count
        self._penalty = (sigma / _CORNER) ** 4 * (2 - 2 * np.cos(angles)) ** 2

    def nearest(self, target: Poses, other: Poses | None = None, weight: float = 0.0) -> Poses:
        """Smooth poses near `target` and, with `weight`, near `other`."""
        wanted = target if other is None else target + weight * other
        gains = 1 / (1 + weight + self._penalty)
        mirrored = np.concatenate([wanted, wanted[::-1]])
        spectrum = np.fft.rfft(mirrored, axis=0) * gains[:, None]
        smooth = np.fft.irfft(spectrum, n=len(mirrored), axis=0)[: len(wanted)]
        return np.asarray(smooth, dtype=np.float64)


@dataclass
class _LiveState:
    """The virtual camera after a frame."""

    view_from_raw: Transform  # of the frame, without the crop
    speed: Poses  # (4,): motion of the virtual camera per frame, in its own pixels


class StabilizedCamera(DeepCopied):
    """A virtual camera that follows the camera smoothly, one frame at a time, without delay.

    It moves at the camera's mean velocity, so that it does not lag behind a steady pan, and faster
    the more crop the correction needs.

    Threads: one thread at a time for each object; several objects are independent.

    Parameters
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.
    fps : float
        Frames per second.
    crop : Crop
        The share cannot be chosen for a clip that is not known: 0.1 if none is given.
    smoothing : float
        Seconds that the virtual camera takes to follow a change.

    Attributes
    ----------
    share : float
        Share of width and of height that is cropped.
    """

    def __init__(
        self,
        size_wh: tuple[int, int],
        fps: float,
        *,
        crop: Crop = AUTO_CROP,
        smoothing: float = _LIVE_SMOOTHING,
    ) -> None:
        self.share = _LIVE_CROP if crop.share is None else crop.share
        self._budget = _LIVE_CROP if crop.share is None else crop.budget
        self._size_wh = size_wh
        self._memory = math.exp(-1 / max(smoothing * fps, 1e-6))
        self._catch_up = -math.expm1(-1 / (_LIVE_CATCHING_UP * fps))
        self._state = _LiveState(IDENTITY, np.zeros(4))

    def update(self, motion: Motion) -> CameraView:
        """The view of the next frame, given the camera's motion to it.

        The view stays as it is if the motion is not reliable.

        Raises
        ------
        FrameSizeError
            The motion is that of frames of another size.
        """
        if motion.size_wh != self._size_wh:
            raise FrameSizeError(
                f"motion has size_wh {motion.size_wh}: the virtual camera was made for frames of "
                f"{self._size_wh[0]}x{self._size_wh[1]} pixels"
            )
        if motion.reliable:
            self._follow(motion)
        return CameraView(
            cropped(self._state.view_from_raw, self.share, self._size_wh), self._size_wh
        )

    def _follow(self, motion: Motion) -> None:
        """Move the virtual camera by its speed and by shares of what is left to the camera.

        With the squared memory these shares are those of a second-order filter of fading memory
        (alpha = 1 - r^2, beta = (1 - r)^2), which follows a constant velocity without lag.
        """
        state, memory = self._state, self._memory
        held_from_raw = state.view_from_raw @ np.linalg.inv(motion.cur_from_prev)
        moved_from_raw = self._moved(held_from_raw, state.speed)
        left = pose_of(moved_from_raw, self._size_wh)
        speed = state.speed + (1 - memory) ** 2 * left
        view_from_raw = self._moved(moved_from_raw, (1 - memory**2) * left)
        for _ in range(_LIVE_ROUNDS):
            excess = self._excess(view_from_raw)
            if excess <= 0:
                break
            pulled = pose_of(view_from_raw, self._size_wh)
            view_from_raw = self._moved(view_from_raw, excess * pulled)
            speed = speed + excess * self._catch_up * pulled
            if float(needed_crop(view_from_raw, self._size_wh)) <= self._budget:
                break
        self._state = _LiveState(view_from_raw, speed)

    def _excess(self, view_from_raw: Transform) -> float:
        """Share of the correction to take back, so that the crop stays in its budget."""
        needed = float(needed_crop(view_from_raw, self._size_wh))
        soft = _LIVE_SOFT * self._budget
        if needed <= soft:
            return 0.0
        room = self._budget - soft
        allowed = soft + room * math.tanh((needed - soft) / room)
        return 1 - allowed / needed

    def _moved(self, view_from_raw: Transform, pose: Poses) -> Transform:
        """`view_from_raw` after the virtual camera has moved by `pose` (4,), in its own pixels."""
        moved_from_held = np.linalg.inv(held_from_moved(pose, self._size_wh))
        return np.asarray(moved_from_held @ view_from_raw, dtype=np.float64)
