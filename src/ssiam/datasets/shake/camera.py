"""`Shake`: how a camera shakes, and `ShakingCamera`, which renders its images."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Final, Literal, TypeAlias, get_args

import cv2
import numpy as np

from ssiam.datasets.shake.path import (
    SHAKE_KINDS,
    Floats,
    ShakeKind,
    ShakePath,
    deviations,
    sample_path,
)
from ssiam.errors import ArgumentError, check_choice
from ssiam.geometry import Image, Points, Transform

ShakeBorder: TypeAlias = Literal["reflect", "crop"]
SHAKE_BORDERS: Final[tuple[ShakeBorder, ...]] = get_args(ShakeBorder)

_REACH: Final = 3.0  # standard deviations at which a path is limited if the border is cropped
_MIN_SIDE: Final = 16  # px of the cropped output

_EXPOSURE_STEPS: Final = 11  # images that are averaged for a motion-blurred one
# Fixed-point iterations that find the row in which a point is read. Each multiplies the error by
# the distance, in frame heights, that the camera moves during the readout.
_READOUT_ITERATIONS: Final = 25


@dataclass(frozen=True)
class Shake:
    """Parameters of camera shake.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    strength : float
        Standard deviation of the path, as a share of the frame width: 0.03 is 3 %. Shifts are
        along x and y, with a roll of 1 degree for each 3 %; for the kinds "roll" and "zoom" it is
        the shift of a pixel half a width from the center.
    kind : {"white", "handheld", "vibration", "gusts", "roll", "zoom"}
        "white": independent in every frame. "handheld": amplitude 1/f above 0.01 cycles per frame;
        the step between two frames is about a quarter of the strength. "vibration": five sinusoids
        of 0.15 to 0.5 cycles per frame with modulated amplitude. "gusts": impulses, one in twenty
        frames, that decay to 37 % in ten frames. "roll" and "zoom": white noise, about the center.
    seed : int
        Another seed gives another path of the same kind.
    exposure : float
        Share of the frame interval, 0 to 1, during which the shutter is open.
    readout : float
        Share of the frame interval, 0 to 1, from reading the first row to reading the last.
    border : {"reflect", "crop"}
        "reflect" extends the frame by its mirror image. "crop" makes the output smaller than the
        frame, so that no extension is visible, and limits the path to three standard deviations.

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
                raise ArgumentError(f"{name} of shake is {value}: give a share from 0 to 1")
        if self.seed < 0:
            raise ArgumentError(f"seed of shake is {self.seed}: give 0 or more")

    @property
    def label(self) -> str:
        """Name for folders: kind, strength, seed, and the other values that are not the default."""
        default = Shake(self.strength, self.kind, self.seed)
        changed = [
            f"{field.name}={getattr(self, field.name)}"
            for field in fields(self)
            if getattr(self, field.name) != getattr(default, field.name)
        ]
        return "-".join([self.kind, str(float(self.strength)), f"seed{self.seed}", *changed])


def camera_path(shake: Shake, count: int, size_wh: tuple[int, int], name: str = "") -> Transform:
    """shaken_from_raw (count, 3, 3) float64 of every frame; it depends only on the arguments.

    Parameters
    ----------
    shake : Shake
        Another strength scales the same path.
    count : int
        Number of frames.
    size_wh : (int, int)
        Width and height of the raw frames, pixels.
    name : str
        Name of the sequence: another name gives another path.

    Raises
    ------
    ArgumentError
        Less than 16 pixels of the width or height are left after cropping.
    """
    return shaking_camera(shake, count, size_wh, name).poses(np.arange(count, dtype=np.float64))


def shaking_camera(shake: Shake, count: int, size_wh: tuple[int, int], name: str) -> ShakingCamera:
    """The camera whose poses `camera_path` returns."""
    path = sample_path(shake.kind, shake.strength, shake.seed, count, size_wh, name)
    if shake.border == "crop":
        path = _cropped(path, shake, size_wh)
    (width, height), (left, top) = size_wh, path.corner_xy
    out_wh = width - 2 * left, height - 2 * top
    if min(out_wh) < _MIN_SIDE and shake.border == "crop" and shake.strength:
        raise ArgumentError(
            f"shake of strength {shake.strength}: cropping leaves nothing of {width}x{height} "
            "pixels; shake less, or reflect the border"
        )
    return ShakingCamera(path, out_wh, shake.exposure, shake.readout)


def _cropped(path: ShakePath, shake: Shake, size_wh: tuple[int, int]) -> ShakePath:
    """The path with limits, and with an output that stays inside the raw frame."""
    limits = _REACH * shake.strength * deviations(shake.kind, size_wh[0])
    dx, dy, angle, log_zoom = limits.tolist()
    x, y = path.center_xy
    shrunk = -math.expm1(-log_zoom)
    corner_xy = math.ceil(x * shrunk + dx + angle * y), math.ceil(y * shrunk + dy + angle * x)
    return replace(path, limits=limits, corner_xy=corner_xy)


@dataclass(frozen=True, eq=False)
class ShakingCamera:
    """A camera on a path, with motion blur and a rolling shutter.

    Attributes
    ----------
    path : ShakePath
    size_wh : (int, int)
        Width and height of its images, pixels.
    exposure : float
        Share of the frame interval, 0 to 1, centered on the frame's time.
    readout : float
        Share of the frame interval from the first row to the last; the middle row is read at the
        frame's time.
    """

    path: ShakePath
    size_wh: tuple[int, int]
    exposure: float = 0.0
    readout: float = 0.0

    def poses(self, times: Floats) -> Transform:
        """shaken_from_raw (..., 3, 3) at times (...) in frames: the mean over the exposure.

        The mean of the matrices maps a point to the centroid of its blur.
        """
        moments = times[..., None] + self._exposure_times()
        return np.asarray(self.path.at(moments).mean(axis=-3))

    def row_poses(self, points: Points, frames: Floats) -> Transform:
        """shaken_from_raw (P, 3, 3) of the rows that read raw points (P, 2) of frames (P,)."""
        if self.readout == 0:
            return self.poses(frames)
        moments = frames[:, None] + self._exposure_times()
        poses = self.path.at(moments)
        for _ in range(_READOUT_ITERATIONS):
            rows = np.einsum("pkj,pj->pk", poses[..., 1, :2], points) + poses[..., 1, 2]
            poses = self.path.at(moments + self._delays(rows))
        return np.asarray(poses.mean(axis=1))

    def render(self, raw: Image, index: int) -> Image:
        """The camera's image (H, W, 3) uint8 BGR of the raw frame with index `index`."""
        times = index + self._exposure_times()
        if len(times) == 1:
            return self._exposed(raw, times[0])
        total = np.zeros((*self.size_wh[::-1], 3), dtype=np.float32)
        for time in times:
            cv2.accumulate(self._exposed(raw, time), total)
        return np.rint(total / len(times)).astype(np.uint8)

    def _exposure_times(self) -> Floats:
        if self.exposure == 0:
            return np.zeros(1)
        return self.exposure * ((np.arange(_EXPOSURE_STEPS) + 0.5) / _EXPOSURE_STEPS - 0.5)

    def _delays(self, rows: Floats) -> Floats:
        """Times at which rows are read, in frames after the middle row."""
        height = self.size_wh[1]
        return self.readout * ((np.clip(rows, 0, height - 1) + 0.5) / height - 0.5)

    def _exposed(self, raw: Image, time: float) -> Image:
        mirrored = cv2.BORDER_REFLECT_101
        if self.readout == 0:
            pose = self.path.at(time)[:2]
            return np.asarray(
                cv2.warpAffine(raw, pose, self.size_wh, borderMode=mirrored), dtype=np.uint8
            )
        x, y = self._raw_positions(time)
        image = cv2.remap(raw, x, y, cv2.INTER_LINEAR, borderMode=mirrored)
        return np.asarray(image, dtype=np.uint8)

    def _raw_positions(
        self, time: float
    ) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float32]]]:
        """Raw x and y (H, W) of every pixel, with the pose at the time of its row."""
        width, height = self.size_wh
        columns, rows = np.arange(width), np.arange(height, dtype=np.float64)[:, None]
        raw_from_shaken = np.linalg.inv(self.path.at(time + self._delays(rows[:, 0])))
        return [
            (a * columns + b * rows + c).astype(np.float32)
            for a, b, c in (raw_from_shaken[:, axis, :, None].swapaxes(0, 1) for axis in (0, 1))
        ]
