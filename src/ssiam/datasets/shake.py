"""`Shake`: how a camera shakes, and the exact path that this makes."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Final, Literal, TypeAlias, get_args

import numpy as np

from ssiam.datasets.camera_paths import SHAKE_KINDS, CameraPath, ShakeKind, deviations, path_of
from ssiam.datasets.exposure import ShakingCamera
from ssiam.errors import ArgumentError, check_choice
from ssiam.geometry import Transform

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
    path = path_of(shake.kind, shake.strength, shake.seed, count, size_wh, name)
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
