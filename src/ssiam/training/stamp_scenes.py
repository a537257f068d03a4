"""How a pasted scene is drawn: the camera's way, that of the objects, and their light."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image

SIZE_WH = (640, 480)  # pixels of a scene

# Long side of an object, pixels: half of them are smaller than the geometric mean of these.
_OBJECT = (40.0, 260.0)
_TILT = 12.0  # degrees, standard deviation of an object's roll
# Share of the background picture's shorter side that the camera sees.
_SEEN = (0.55, 1.0)
_LIGHT = 0.2  # standard deviation of the log of each colour's gain

# A rival: how far away its middle is, in long sides of the target; how much its size may differ.
_APART = (0.4, 1.6)
_UNLIKE = 0.1

# From frame to frame, standard deviations.
_STEP = 9.0  # pixels
_TURN = 3.0  # degrees
_GROWTH = 0.05  # log
_FLICKER = 0.04  # log

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """Where something is in the scene, and in which light.

    Attributes
    ----------
    place : (float, float)
        Shares of the scene's width and height.
    size : float
        0..1, from the smallest to the largest.
    shift : (float, float)
        Pixels away from the place, in this frame.
    angle : float
        Degrees.
    growth : float
        Factor of its size in this frame.
    gains : (3,) float64
        Factors of blue, green and red.
    mirrored : bool
    """

    place: tuple[float, float]
    size: float
    shift: tuple[float, float]
    angle: float
    growth: float
    gains: Floats
    mirrored: bool

    def seen_by(self, camera: Pose) -> Pose:
        """The pose moved along with the camera's picture."""
        (x, y), (dx, dy) = self.shift, camera.shift
        return replace(self, shift=(x + dx, y + dy))


def poses(rng: np.random.Generator, frames: int) -> list[Pose]:
    """A random way of `frames` poses, small steps apart."""
    place, size = rng.uniform(0.15, 0.85, 2), rng.random()
    angle, gains, mirrored = _TILT * rng.normal(), _LIGHT * rng.normal(size=3), rng.random() < 0.5
    steps = np.cumsum(rng.normal(size=(frames, 5)), axis=0)
    return [
        Pose(
            place=(float(place[0]), float(place[1])),
            size=float(size),
            shift=(_STEP * float(step[0]), _STEP * float(step[1])),
            angle=angle + _TURN * float(step[2]),
            growth=float(np.exp(_GROWTH * step[3])),
            gains=np.exp(gains / 2 + _FLICKER * step[4]),
            mirrored=bool(mirrored),
        )
        for step in steps
    ]


def beside(target: Pose, own: Pose, rng: np.random.Generator) -> Pose:
    """The pose of a rival of a way of its own: next to the target, which it goes along with."""
    size = float(np.clip(target.size + rng.uniform(-_UNLIKE, _UNLIKE), 0, 1))
    distance = rng.uniform(*_APART) * _long_side(target)
    direction = rng.uniform(0, 2 * np.pi)
    x, y = distance * np.cos(direction), distance * np.sin(direction)
    place = (target.place[0] + x / SIZE_WH[0], target.place[1] + y / SIZE_WH[1])
    return replace(own.seen_by(target), place=place, size=size)


def backdrop(picture: Image, camera: Pose) -> Image:
    """The scene (480, 640, 3) without objects: a part of a picture, mirrored beyond its edges."""
    width, height = SIZE_WH
    low, high = _SEEN
    seen = (low + (high - low) * camera.size) * min(
        picture.shape[1] / width, picture.shape[0] / height
    )
    free_x, free_y = picture.shape[1] - seen * width, picture.shape[0] - seen * height
    left = free_x * camera.place[0] - seen * camera.shift[0]
    top = free_y * camera.place[1] - seen * camera.shift[1]
    picture_from_scene = np.array([[seen, 0, left], [0, seen, top]])
    scene = cv2.warpAffine(
        picture,
        picture_from_scene,
        SIZE_WH,
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REFLECT_101,
    )
    return _lit(np.asarray(scene, dtype=np.uint8), camera.gains)


def paste(scene: Image, stamp: Image, pose: Pose) -> NDArray[np.bool_]:
    """Draw a stamp (H, W, 4) BGRA into the scene; where it covers half of a pixel (480, 640)."""
    mask = np.zeros(scene.shape[:2], dtype=np.bool_)
    stamp, zoom = _shrunk(stamp, pose)
    scene_from_stamp = _scene_from_stamp(stamp, pose, zoom)
    x, y, w, h = _extent(scene_from_stamp, stamp)
    if w <= 0 or h <= 0:
        return mask
    scene_from_stamp[:, 2] -= x, y
    layer = cv2.warpAffine(_premultiplied(stamp, pose), scene_from_stamp, (w, h))
    part = np.s_[y : y + h, x : x + w]
    alpha = layer[..., 3:]
    scene[part] = np.rint(layer[..., :3] + scene[part] * (1 - alpha)).clip(0, 255)
    mask[part] = alpha[..., 0] >= 0.5
    return mask


def _shrunk(stamp: Image, pose: Pose) -> tuple[Image, float]:
    """The stamp no larger than it is to be, and the zoom that is left to do."""
    zoom = _long_side(pose) / max(stamp.shape[:2])
    if zoom >= 1:
        return stamp, zoom
    small_wh = [max(2, round(zoom * n)) for n in stamp.shape[1::-1]]
    small = cv2.resize(stamp, small_wh, interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8), 1.0


def _long_side(pose: Pose) -> float:
    smallest, largest = _OBJECT
    return float(smallest * (largest / smallest) ** pose.size * pose.growth)


def _premultiplied(stamp: Image, pose: Pose) -> NDArray[np.float32]:
    """Colours times alpha, so that none of hidden pixels bleed in, and alpha 0..1."""
    layer = _lit(stamp, np.append(pose.gains, 1.0)).astype(np.float32)
    layer[..., 3] /= 255
    layer[..., :3] *= layer[..., 3:]
    return layer


def _extent(scene_from_stamp: Floats, stamp: Image) -> tuple[int, int, int, int]:
    """The part x, y, w, h of the scene that a stamp can reach."""
    height, width = stamp.shape[:2]
    corners = np.array([[-1, -1, 1], [width, -1, 1], [width, height, 1], [-1, height, 1]])
    reached = corners @ scene_from_stamp.T
    left, top = np.clip(np.floor(reached.min(axis=0)), 0, SIZE_WH).astype(int).tolist()
    right, bottom = np.clip(np.ceil(reached.max(axis=0)) + 1, 0, SIZE_WH).astype(int).tolist()
    return left, top, right - left, bottom - top


def _scene_from_stamp(stamp: Image, pose: Pose, zoom: float) -> Floats:
    cos, sin = zoom * np.cos(np.deg2rad(pose.angle)), zoom * np.sin(np.deg2rad(pose.angle))
    cx, cy = (stamp.shape[1] - 1) / 2, (stamp.shape[0] - 1) / 2
    x = pose.place[0] * SIZE_WH[0] + pose.shift[0]
    y = pose.place[1] * SIZE_WH[1] + pose.shift[1]
    across = np.array([-cos, -sin]) if pose.mirrored else np.array([cos, sin])
    down = np.array([-sin, cos])
    return np.stack([across, down, (x, y) - cx * across - cy * down], axis=1)


def _lit(image: Image, gains: Floats) -> Image:
    levels = np.arange(256)[:, None] * gains
    table = np.rint(levels).clip(0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, table[None]), dtype=np.uint8)
