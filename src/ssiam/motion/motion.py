"""`Motion`: what the camera did between two frames."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from ssiam.errors import ArgumentError
from ssiam.geometry import (
    IDENTITY,
    Transform,
    finite_array,
    frame_center,
    rigid_parameters,
    short_repr,
)

_MAX_SHIFT: Final = 0.30  # of the longer side between two frames; beyond it is a cut
_MAX_ANGLE: Final = 0.35  # rad between two frames
_SINGULAR: Final = 1e-9  # determinant of a transform without inverse


@dataclass(frozen=True, eq=False)
class Motion:
    """Camera motion from the previous frame to this one.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    cur_from_prev : (3, 3) float64
        Takes background points of the previous frame to this frame; raw-frame pixels.
    inliers : float
        Share 0..1 of the followed points that agree with it, or of the background's texture
        that it explains.
    reliable : bool
        False where the motion could not be told (black frame, blur, scene cut);
        `cur_from_prev` is then the identity.
    size_wh : (int, int)
        Width and height of the frames, pixels.
    """

    cur_from_prev: Transform
    inliers: float
    reliable: bool
    size_wh: tuple[int, int]

    @classmethod
    def none(cls, size_wh: tuple[int, int], *, reliable: bool = False) -> Motion:
        """The motion that moves nothing: first frames, and frames that tell nothing."""
        return cls(IDENTITY, 1.0 if reliable else 0.0, reliable, size_wh)

    @classmethod
    def given(cls, cur_from_prev: ArrayLike, size_wh: tuple[int, int]) -> Motion:
        """A motion that something other than the picture tells, such as a flight controller.

        Parameters
        ----------
        cur_from_prev : (3, 3) or (2, 3) array
            Takes background points of the previous frame to this frame; raw-frame pixels.
        size_wh : (int, int)
            Width and height of the frames, pixels.

        Raises
        ------
        ValueError
            It is not of that shape, not finite, or cannot be inverted.
        """
        matrix = finite_array(cur_from_prev)
        if matrix is not None and matrix.shape == (2, 3):
            matrix = np.vstack([matrix, IDENTITY[2]])
        if matrix is None or matrix.shape != (3, 3) or abs(np.linalg.det(matrix)) < _SINGULAR:
            raise ArgumentError(
                f"motion is {short_repr(cur_from_prev)}: give a (3, 3) or (2, 3) transform of "
                "pixels that can be inverted"
            )
        return cls(matrix / matrix[2, 2] if matrix[2, 2] else matrix, 1.0, True, size_wh)

    @classmethod
    def from_rotation(
        cls,
        cur_from_prev_rotation: ArrayLike,
        focal_length: float,
        size_wh: tuple[int, int],
        principal_xy: tuple[float, float] | None = None,
    ) -> Motion:
        """What a turn of the camera, told by a gyro or a gimbal, does to the picture.

        A turn moves every point of the scene by the homography ``K R K^-1``, however far away
        it is (Hartley and Zisserman, 2004, section 8.4).

        Parameters
        ----------
        cur_from_prev_rotation : (3, 3) matrix or (3,) rotation vector, radians
            Takes directions from the previous camera's axes (x right, y down, z forward) to
            this one's. The vector is the gyro's rate times the time, with its sign turned: a
            camera that turns to the right sees the scene turn to the left.
        focal_length : float
            Pixels.
        size_wh : (int, int)
            Width and height of the frames, pixels.
        principal_xy : (float, float), optional
            Where the optical axis meets the picture, pixels; its centre unless given.
        """
        rotation = finite_array(cur_from_prev_rotation)
        if rotation is not None and rotation.shape == (3,):
            rotation = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
        if (
            rotation is None
            or rotation.shape != (3, 3)
            or not np.allclose(rotation @ rotation.T, IDENTITY, atol=1e-3)
        ):
            raise ArgumentError(
                f"rotation is {short_repr(cur_from_prev_rotation)}: give a (3, 3) rotation matrix "
                "or a rotation vector of three radians"
            )
        if not isinstance(focal_length, Real) or not 0 < focal_length < math.inf:
            raise ArgumentError(f"focal_length is {focal_length}: give pixels, more than 0")
        x, y = frame_center(size_wh) if principal_xy is None else principal_xy
        camera = np.array([[focal_length, 0, x], [0, focal_length, y], [0, 0, 1]])
        return cls.given(camera @ rotation @ np.linalg.inv(camera), size_wh)

    def placed(self, origin_xy: tuple[int, int], size_wh: tuple[int, int]) -> Motion:
        """The same motion in frames of (width, height), in which these start at `origin_xy`."""
        if size_wh == self.size_wh:
            return self
        there = np.eye(3)
        there[:2, 2] = origin_xy
        back = np.eye(3)
        back[:2, 2] = np.negative(origin_xy)
        cur_from_prev = there @ self.cur_from_prev @ back if self.reliable else IDENTITY
        return Motion(cur_from_prev, self.inliers, self.reliable, size_wh)

    @property
    def shift_angle(self) -> tuple[float, float, float]:
        """(dx, dy, da) of eq. 4, taken at the image centre: pixels, pixels, radians."""
        return rigid_parameters(self.cur_from_prev, frame_center(self.size_wh))


def known_motion(motion: Any, size_wh: tuple[int, int]) -> Motion:
    """A motion that the caller gives for frames of (width, height) pixels, checked.

    `Motion` objects are returned as they are; the rest is as `Motion.given`.
    """
    if not isinstance(motion, Motion):
        return Motion.given(motion, size_wh)
    if motion.size_wh != size_wh:
        width, height = size_wh
        raise ArgumentError(
            f"motion is of frames of {short_repr(motion.size_wh)} pixels: "
            f"give one of {width}x{height} pixels, the frame's own size"
        )
    Motion.given(motion.cur_from_prev, size_wh)
    return motion


def plausible(motion: Motion) -> bool:
    """Whether a camera may have moved so far between two frames."""
    dx, dy, angle = motion.shift_angle
    near = math.hypot(dx, dy) <= _MAX_SHIFT * max(motion.size_wh)
    return near and abs(angle) <= _MAX_ANGLE
