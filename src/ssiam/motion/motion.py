"""`Motion`: the camera motion between two frames."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import (
    IDENTITY,
    XYWH,
    Transform,
    finite_array,
    frame_center,
    inverse,
    map_box,
    rigid,
    rigid_parameters,
    short_repr,
)
from ssiam.motion.mesh import MotionMesh
from ssiam.motion.models import fractional

_MAX_SHIFT: Final = 0.30  # of the longer side between two frames; larger is a scene cut
_MAX_ANGLE: Final = 0.35  # rad between two frames
_MAX_STRETCH: Final = 2.0  # of lengths in any direction, between two frames; and at most halved
_MAX_ENTRY: Final = 1e12  # of a transform's matrix; products of four are finite
_MAX_DISTANCE: Final = 1000.0  # of a mapped corner from the origin, in longer sides of the frame
_MIN_DETERMINANT: Final = 1e-9  # of an invertible transform


@dataclass(frozen=True, eq=False, repr=False)
class Motion:
    """Camera motion from the previous frame to this one.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    cur_from_prev : (3, 3) float64
        Maps background points of the previous frame to this frame; raw-frame pixels.
    inliers : float
        0..1: share of the tracked keypoints that agree with the transform, or of the background's
        texture that it explains.
    reliable : bool
        False if the motion could not be estimated (black frame, blur, scene cut);
        `cur_from_prev` is then the identity.
    size_wh : (int, int)
        Width and height of the frames, pixels.
    mesh : MotionMesh or None
        How the motion differs from place to place, with ``CameraMotion(model="mesh")``.
    """

    cur_from_prev: Transform
    inliers: float
    reliable: bool
    size_wh: tuple[int, int]
    mesh: MotionMesh | None = None

    @classmethod
    def none(cls, size_wh: tuple[int, int], *, reliable: bool = False) -> Motion:
        """The identity, for first frames and for frames whose motion cannot be estimated."""
        return cls(IDENTITY, 1.0 if reliable else 0.0, reliable, size_wh)

    @classmethod
    def from_transform(cls, cur_from_prev: ArrayLike, size_wh: tuple[int, int]) -> Motion:
        """A motion known from another source, such as a flight controller.

        Parameters
        ----------
        cur_from_prev : (3, 3) or (2, 3) array
            Maps background points of the previous frame to this frame; raw-frame pixels.
        size_wh : (int, int)
            Width and height of the frames, pixels.

        Raises
        ------
        ArgumentError
            The array has another shape, is not finite or cannot be inverted, or it or its inverse
            moves a corner of the frame by more than a thousand frames, or to infinity.
        """
        matrix = finite_array(cur_from_prev)
        if matrix is not None and matrix.shape == (2, 3):
            matrix = np.vstack([matrix, IDENTITY[2]])
        if matrix is None or matrix.shape != (3, 3) or not _is_invertible(matrix):
            raise ArgumentError(
                f"motion is {short_repr(cur_from_prev)}: give an invertible (3, 3) or (2, 3) "
                "transform of pixels"
            )
        if not (_keeps_frame(matrix, size_wh) and _keeps_frame(inverse(matrix), size_wh)):
            width, height = size_wh
            raise ArgumentError(
                f"motion {short_repr(matrix.tolist())} moves frames of {width}x{height} pixels out "
                "of all bounds: give the motion between two frames of a video"
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
        """The motion of a rotating camera, measured by a gyro or a gimbal.

        A rotation maps every scene point by the homography ``K R K^-1``, regardless of its distance
        (Hartley and Zisserman, 2004, section 8.4).

        Parameters
        ----------
        cur_from_prev_rotation : (3, 3) matrix or (3,) rotation vector, radians
            Maps directions from the previous camera's axes (x right, y down, z forward) to
            this one's. The vector is the gyro's angular rate times the time, with opposite sign:
            when the camera pans to the right, the scene moves to the left.
        focal_length : float
            Pixels.
        size_wh : (int, int)
            Width and height of the frames, pixels.
        principal_xy : (float, float), optional
            Principal point, pixels; the frame center by default.

        Raises
        ------
        ArgumentError
            The matrix is not a rotation, or the focal length is not positive and finite.
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
        return cls.from_transform(camera @ rotation @ np.linalg.inv(camera), size_wh)

    def uncropped(self, origin_xy: tuple[int, int], size_wh: tuple[int, int]) -> Motion:
        """The motion of the whole frames, where this is the motion of a crop of them.

        Parameters
        ----------
        origin_xy : (int, int)
            Top left corner of the crop in the whole frame, pixels.
        size_wh : (int, int)
            Width and height of the whole frames, pixels.
        """
        if size_wh == self.size_wh:
            return self
        frame_from_crop, crop_from_frame = np.eye(3), np.eye(3)
        frame_from_crop[:2, 2] = origin_xy
        crop_from_frame[:2, 2] = np.negative(origin_xy)
        cur_from_prev = (
            frame_from_crop @ self.cur_from_prev @ crop_from_frame if self.reliable else IDENTITY
        )
        mesh = None if self.mesh is None else self.mesh.moved(origin_xy)
        return Motion(cur_from_prev, self.inliers, self.reliable, size_wh, mesh)

    def at(self, point: tuple[float, float]) -> Transform:
        """cur_from_prev (3, 3) of the background near a point (x, y) of the previous frame.

        With a mesh, that of the surroundings of this point; otherwise the same for all points.
        """
        if self.mesh is None:
            return self.cur_from_prev
        return self.cur_from_prev @ rigid(*self.mesh.shift_at(point), 0.0)

    def map_box(self, xywh: XYWH) -> XYWH:
        """The box (x, y, w, h), pixels, of what stands still in `xywh` of the previous frame."""
        x, y, w, h = xywh
        return map_box(self.at((x + w / 2, y + h / 2)), xywh)

    def rows(self, readout: float) -> NDArray[np.float64]:
        """Undo a rolling shutter: where the pixels of each row were in the middle of the readout.

        The camera is assumed to have kept the speed of this motion. `GyroTrack.rows` needs no such
        assumption.

        Parameters
        ----------
        readout : float
            Time from the first row to the last one as a share of the time between two frames;
            negative if the last row is read first.

        Returns
        -------
        (H, 3, 3) float64
            middle_from_row: maps the pixels of each row of this frame to where they would be if
            all rows had been exposed with the middle one.

        Raises
        ------
        ArgumentError
            `readout` is not in -1..1, or the motion is not a small change of the frame.
        """
        share = finite_array(readout)
        if share is None or share.shape != () or not abs(share) <= 1:
            raise ArgumentError(
                f"readout is {short_repr(readout)}: give a share of the frame time, -1 to 1"
            )
        later = float(share) * row_offsets(self.size_wh[1])
        middle_from_row = fractional(self.cur_from_prev, -later)
        if not np.isfinite(middle_from_row).all():
            raise ArgumentError(f"{self!r} is too large for a motion at constant speed")
        return middle_from_row

    @property
    def shift_angle(self) -> tuple[float, float, float]:
        """(dx, dy, da) of eq. 4, taken at the frame center: pixels, pixels, radians."""
        return rigid_parameters(self.cur_from_prev, frame_center(self.size_wh))

    @property
    def is_plausible(self) -> bool:
        """Whether a camera can move this far between two frames.

        A shift of the center by up to 30 % of the longer side, a roll of up to 20 degrees, and at
        the center and the corners of the frame a zoom or tilt that at most doubles or halves
        lengths. False for a matrix that is not finite.
        """
        dx, dy, angle = self.shift_angle
        is_near = math.hypot(dx, dy) <= _MAX_SHIFT * max(self.size_wh)
        return is_near and abs(angle) <= _MAX_ANGLE and _stretches_little(self)

    def __repr__(self) -> str:
        dx, dy, angle = self.shift_angle
        unreliable = "" if self.reliable else ", reliable=False"
        return f"Motion(dx={dx:.1f}, dy={dy:.1f}, angle={angle:.4f}{unreliable})"


def row_offsets(height: int) -> NDArray[np.float64]:
    """Share (H,) of a readout from the middle row to each row, -.5..+.5."""
    return (np.arange(height) - (height - 1) / 2) / max(height - 1, 1)


def _stretches_little(motion: Motion) -> bool:
    (a, b, c), (d, e, f), (g, h, i) = motion.cur_from_prev.tolist()
    width, height = motion.size_wh
    corners = [(0, 0), (width, 0), (0, height), (width, height)] if g or h else []
    for x, y in (frame_center(motion.size_wh), *corners):
        weight = g * x + h * y + i
        if weight * i <= 0:  # the horizon is in the frame
            return False
        u, v = (a * x + b * y + c) / weight, (d * x + e * y + f) / weight
        # Derivative of u, v with respect to x, y, and its singular values; the smaller one is
        # negative for a mirrored frame.
        ux, uy = (a - u * g) / weight, (b - u * h) / weight
        vx, vy = (d - v * g) / weight, (e - v * h) / weight
        turned, mirrored = math.hypot(ux + vy, vx - uy), math.hypot(ux - vy, vx + uy)
        largest, smallest = (turned + mirrored) / 2, (turned - mirrored) / 2
        if not (largest <= _MAX_STRETCH and smallest * _MAX_STRETCH >= 1):
            return False
    return True


def _is_invertible(to_from_from: Transform) -> bool:
    """Whether a transform has moderate numbers, and a determinant that is not about 0."""
    (a, b, c), (d, e, f), (g, h, i) = to_from_from.tolist()
    if max(map(abs, (a, b, c, d, e, f, g, h, i))) >= _MAX_ENTRY:
        return False
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return bool(abs(determinant) >= _MIN_DETERMINANT)


def _keeps_frame(to_from_from: Transform, size_wh: tuple[int, int]) -> bool:
    """Whether the corners of a frame stay in front of the camera, and within a wide area."""
    (a, b, c), (d, e, f), (g, h, i) = to_from_from.tolist()
    width, height = size_wh
    corners = (0, 0), (width, 0), (width, height), (0, height)
    weights = [g * x + h * y + i for x, y in corners]
    if not (min(weights) > 0 or max(weights) < 0):
        return False
    limit = _MAX_DISTANCE * max(size_wh)
    return all(
        abs((a * x + b * y + c) / weight) <= limit and abs((d * x + e * y + f) / weight) <= limit
        for (x, y), weight in zip(corners, weights, strict=True)
    )


def as_motion(motion: Any, size_wh: tuple[int, int]) -> Motion:
    """Check a `Motion` or a transform given by the caller, and return it as a `Motion`.

    Parameters
    ----------
    motion : Motion or (3, 3) or (2, 3) array
        An array is converted by `Motion.from_transform`.
    size_wh : (int, int)
        Width and height of the frames, pixels.

    Raises
    ------
    ArgumentError
        It is the motion of frames of another size, or is not an invertible transform.
    """
    if not isinstance(motion, Motion):
        return Motion.from_transform(motion, size_wh)
    if motion.size_wh != size_wh:
        width, height = size_wh
        raise ArgumentError(
            f"motion has size_wh {short_repr(motion.size_wh)}: "
            f"give the motion of frames of {width}x{height} pixels"
        )
    Motion.from_transform(motion.cur_from_prev, size_wh)
    return motion
