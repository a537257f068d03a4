"""`Shake`: how a camera shakes, and `ShakingCamera`, which renders its images."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Final, Literal, TypeAlias, get_args

import cv2
import numpy as np

from ssiam.datasets.shake.paths import (
    SHAKE_KINDS,
    CameraPath,
    Floats,
    ShakeKind,
    deviations,
    sample_path,
)
from ssiam.errors import ArgumentError, check_choice
from ssiam.geometry import Image, Points, Transform

ShakeBorder: TypeAlias = Literal["reflect", "crop"]
SHAKE_BORDERS: Final[tuple[ShakeBorder, ...]] = get_args(ShakeBorder)

_REACH: Final = 3.0  # standard deviations at which a path is cut off where the border is cropped
_LEAST: Final = 16  # pixels, the smallest side that cropping may leave


@dataclass(frozen=True)
class Shake:
    """How a camera shakes.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    strength : float
        Standard deviation of the path, as a share of the picture's width: 0.03 is 3 %. Shifts go
        along x and y, with a roll of 1 degree for each 3 %; of the kinds "roll" and "zoom" it is
        how far a pixel moves that lies half a width off the centre.
    kind : {"white", "handheld", "vibration", "gusts", "roll", "zoom"}
        "white": every frame anew. "handheld": a wander whose amplitude falls as 1/f from 0.01
        cycles a frame on; a step from frame to frame is about a quarter of the strength.
        "vibration": five sinusoids of 0.15 to 0.5 cycles a frame that swell and fade. "gusts":
        kicks, one in twenty frames, of which 37 % is left ten frames later. "roll" and "zoom":
        white too, about the centre.
    seed : int
        Another seed is another path of the same kind.
    exposure : float
        Share of the frame interval, 0 to 1, during which the shutter is open.
    readout : float
        Share of the frame interval, 0 to 1, from reading the first row to reading the last.
    border : {"reflect", "crop"}
        What is seen beyond the picture: its mirror image, or nothing: the output is then a
        smaller window of the picture, and the path ends at three standard deviations.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    strength: float
    kind: ShakeKind = "white"
    seed: int = 0
    exposure: float = 0.0
    readout: float = 0.0
    border: ShakeBorder = "reflect"

    def __post_init__(self) -> None:
        check_choice("kind of shake", self.kind, SHAKE_KINDS)
        check_choice("border of shake", self.border, SHAKE_BORDERS)
        for name in ("strength", "exposure", "readout"):
            if not 0 <= (value := getattr(self, name)) <= 1:
                raise ArgumentError(f"{name} of shake {value}: give a share from 0 to 1")
        if self.seed < 0:
            raise ArgumentError(f"seed of shake {self.seed}: give 0 or more")

    @property
    def label(self) -> str:
        """Its name in a path: kind, strength, seed, and what else is not as by default."""
        own = Shake(self.strength, self.kind, self.seed)
        changed = [
            f"{field.name}={getattr(self, field.name)}"
            for field in fields(self)
            if getattr(self, field.name) != getattr(own, field.name)
        ]
        return "-".join([self.kind, str(float(self.strength)), f"seed{self.seed}", *changed])


def camera_path(shake: Shake, count: int, size_wh: tuple[int, int], name: str = "") -> Transform:
    """shaken_from_raw (count, 3, 3) of every frame; the same for the same arguments anywhere.

    Parameters
    ----------
    shake : Shake
        Another strength gives the same path, larger or smaller.
    count : int
        Number of frames.
    size_wh : (int, int)
        Width and height of the raw frames, pixels.
    name : str
        Another name gives another path: that of the sequence, so that each has its own.

    Raises
    ------
    ArgumentError
        Cropping leaves nothing of the picture.
    """
    return shaking_camera(shake, count, size_wh, name).poses(np.arange(count, dtype=np.float64))


def shaking_camera(shake: Shake, count: int, size_wh: tuple[int, int], name: str) -> ShakingCamera:
    """The camera whose poses `camera_path` tells."""
    path = sample_path(shake.kind, shake.strength, shake.seed, count, size_wh, name)
    if shake.border == "crop":
        path = _cropped(path, shake, size_wh)
    (width, height), (left, top) = size_wh, path.corner_xy
    out_wh = width - 2 * left, height - 2 * top
    if min(out_wh) < _LEAST and shake.border == "crop" and shake.strength:
        raise ArgumentError(
            f"shake of strength {shake.strength}: cropping leaves nothing of {width}x{height} "
            "pixels; shake less, or reflect the border"
        )
    return ShakingCamera(path, out_wh, shake.exposure, shake.readout)


def _cropped(path: CameraPath, shake: Shake, size_wh: tuple[int, int]) -> CameraPath:
    """The path within its reach, and the window that stays inside of the raw picture on it."""
    limits = _REACH * shake.strength * deviations(shake.kind, size_wh[0])
    dx, dy, angle, log_zoom = limits.tolist()
    x, y = path.center_xy
    small = -math.expm1(-log_zoom)
    corner_xy = math.ceil(x * small + dx + angle * y), math.ceil(y * small + dy + angle * x)
    return replace(path, limits=limits, corner_xy=corner_xy)


# Pictures that a blurred one is the mean of.
_INSTANTS: Final = 11
# Rounds in which a point finds the row that sees it; each leaves the share of the picture's height
# that the camera goes during the readout.
_ROUNDS: Final = 25


@dataclass(frozen=True, eq=False)
class ShakingCamera:
    """A camera on a path, with an exposure that takes time and rows that are read in turn.

    Attributes
    ----------
    path : CameraPath
    size_wh : (int, int)
        Width and height of its pictures, pixels.
    exposure : float
        Share of the frame interval, 0 to 1, centred on the frame's time.
    readout : float
        Share of the frame interval from the first row to the last; the middle of the picture is
        read at the frame's time.
    """

    path: CameraPath
    size_wh: tuple[int, int]
    exposure: float = 0.0
    readout: float = 0.0

    def poses(self, times: Floats) -> Transform:
        """shaken_from_raw (..., 3, 3) at times (...) in frames: the mean over the exposure.

        The mean of the matrices takes a point to where the centroid of its blur is.
        """
        moments = times[..., None] + self._instants()
        return np.asarray(self.path.at(moments).mean(axis=-3))

    def poses_seeing(self, points: Points, frames: Floats) -> Transform:
        """shaken_from_raw (P, 3, 3) of the rows that see raw points (P, 2) in frames (P,)."""
        if self.readout == 0:
            return self.poses(frames)
        moments = frames[:, None] + self._instants()
        poses = self.path.at(moments)
        for _ in range(_ROUNDS):
            rows = np.einsum("pkj,pj->pk", poses[..., 1, :2], points) + poses[..., 1, 2]
            poses = self.path.at(moments + self._delays(rows))
        return np.asarray(poses.mean(axis=1))

    def picture(self, raw: Image, index: int) -> Image:
        """What the camera sees (H, W, 3) of the raw frame with that index."""
        times = index + self._instants()
        if len(times) == 1:
            return self._shot(raw, times[0])
        total = np.zeros((*self.size_wh[::-1], 3), dtype=np.float32)
        for time in times:
            cv2.accumulate(self._shot(raw, time), total)
        return np.rint(total / len(times)).astype(np.uint8)

    def _instants(self) -> Floats:
        if self.exposure == 0:
            return np.zeros(1)
        return self.exposure * ((np.arange(_INSTANTS) + 0.5) / _INSTANTS - 0.5)

    def _delays(self, rows: Floats) -> Floats:
        """When rows are read, in frames after the middle one."""
        height = self.size_wh[1]
        return self.readout * ((np.clip(rows, 0, height - 1) + 0.5) / height - 0.5)

    def _shot(self, raw: Image, time: float) -> Image:
        mirrored = cv2.BORDER_REFLECT_101
        if self.readout == 0:
            pose = self.path.at(time)[:2]
            return np.asarray(
                cv2.warpAffine(raw, pose, self.size_wh, borderMode=mirrored), dtype=np.uint8
            )
        x, y = self._raw_places(time)
        seen = cv2.remap(raw, x, y, cv2.INTER_LINEAR, borderMode=mirrored)
        return np.asarray(seen, dtype=np.uint8)

    def _raw_places(self, time: float) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float32]]]:
        """Raw x and y (H, W) of every pixel, each row seen from the pose at its own time."""
        width, height = self.size_wh
        columns, rows = np.arange(width), np.arange(height, dtype=np.float64)[:, None]
        raw_from_shaken = np.linalg.inv(self.path.at(time + self._delays(rows[:, 0])))
        return [
            (a * columns + b * rows + c).astype(np.float32)
            for a, b, c in (raw_from_shaken[:, axis, :, None].swapaxes(0, 1) for axis in (0, 1))
        ]
