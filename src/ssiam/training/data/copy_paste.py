"""Copy-paste scenes: cut-out objects (PNGs with alpha) pasted on background images.

A scene is a few frames in which object, camera and lighting change slightly; its masks are exact.
Each object is pasted several times, at other positions and on other backgrounds. Distractors are
other objects of similar size near the target, in front of it or behind it.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import SourceError
from ssiam.geometry import XYWH, Image
from ssiam.training.data.images import read_cached, read_unchanged
from ssiam.training.data.masks import Mask, box_of_mask

__all__ = ["CopyPasteSource", "CopyPasteTrack"]

_FRAMES: Final = 3
_SCENES: Final = 32  # per object
_COMPANION: Final = 0.4  # probability of another object in the scene, behind the target
_MAX_DISTRACTORS: Final = 3
_CACHED_FRAMES: Final = 4
_CACHED_OBJECTS: Final = 16

_SIZE_WH: Final = (640, 480)  # px, of a frame
# Long side of an object, px; the median is the geometric mean of the two.
_OBJECT_SIDE: Final = (40.0, 260.0)
_ROTATION: Final = 12.0  # degrees, standard deviation of an object's rotation
_VIEW: Final = (0.55, 1.0)  # fraction of the background's shorter side that the camera sees
_LIGHT: Final = 0.2  # standard deviation of the log of each color gain

# A distractor's distance, in long sides of the target, and the difference of its size (0..1).
_DISTANCE: Final = (0.4, 1.6)
_SIZE_DIFFERENCE: Final = 0.1

# Standard deviations of the changes from frame to frame.
_STEP: Final = 9.0  # px
_TURN: Final = 3.0  # degrees
_GROWTH: Final = 0.05  # log of the scale
_FLICKER: Final = 0.04  # log of the gain

Floats: TypeAlias = NDArray[np.float64]


class _Frame(NamedTuple):
    image: Image
    mask: Mask


@dataclass(frozen=True)
class CopyPasteTrack:
    """A track of a cut-out object on a background.

    Attributes
    ----------
    object_path, background : Path
    companion : Path, optional
        Another object behind the target.
    distractors : tuple of Path
        Other objects near the target; every second one is in front of it.
    tumbles : bool
        The target has an arbitrary rotation in each frame.
    seed : int
        Determines positions, sizes, lighting and motion.
    frames : int
    """

    object_path: Path
    background: Path
    companion: Path | None = None
    distractors: tuple[Path, ...] = ()
    tumbles: bool = False
    seed: int = 0
    frames: int = _FRAMES

    @property
    def scene_ids(self) -> tuple[str, ...]:
        """The paths of the objects and of the background."""
        paths = (self.object_path, self.background, self.companion, *self.distractors)
        return tuple(str(path) for path in paths if path)

    def image(self, t: int) -> Image:
        """The frame, 640 x 480 px."""
        return _rendered(self, t).image

    def box(self, t: int) -> XYWH | None:
        """The bounding box of the target's visible part."""
        return box_of_mask(self.mask(t))

    def mask(self, t: int) -> Mask:
        """The pixels that are at least half covered by the target, and by no distractor."""
        return _rendered(self, t).mask


@dataclass(frozen=True, eq=False)
class CopyPasteSource:
    """A `Source` of copy-paste scenes.

    Attributes
    ----------
    name : str
    objects, backgrounds : tuple of Path
    weight : float
    alike : bool
        Whether two files may show the same object.
    rivals : float
        Fraction 0..1 of the scenes with one to three distractors.
    tumbling : float
        Fraction 0..1 of the scenes whose target tumbles.
    """

    name: str
    objects: tuple[Path, ...]
    backgrounds: tuple[Path, ...]
    weight: float = 1.0
    alike: bool = False
    rivals: float = 0.0
    tumbling: float = 0.0

    def __len__(self) -> int:
        """Number of scenes."""
        return _SCENES * len(self.objects)

    def track(self, i: int) -> CopyPasteTrack:
        """The scene of an index."""
        target = self.objects[i % len(self.objects)]
        rng = np.random.default_rng([i, zlib.crc32(self.name.encode())])
        background = self.backgrounds[rng.integers(len(self.backgrounds))]
        companion = self.objects[rng.integers(len(self.objects))]
        alone = companion == target or rng.random() >= _COMPANION
        seed = int(rng.integers(1 << 31))
        distractors = self._drawn_distractors(target, rng) if rng.random() < self.rivals else ()
        tumbles = bool(rng.random() < self.tumbling)
        return CopyPasteTrack(
            target, background, None if alone else companion, distractors, tumbles, seed
        )

    def distractors(self, i: int) -> Sequence[int]:
        """Empty: no two scenes have the same frames."""
        return ()

    def _drawn_distractors(self, target: Path, rng: np.random.Generator) -> tuple[Path, ...]:
        drawn = rng.integers(len(self.objects), size=rng.integers(1, _MAX_DISTRACTORS + 1))
        return tuple(self.objects[i] for i in drawn if self.objects[i] != target)


@lru_cache(maxsize=_CACHED_FRAMES)
def _rendered(scene: CopyPasteTrack, t: int) -> _Frame:
    rng = np.random.default_rng(scene.seed)
    camera, target, companion = (_random_poses(rng, scene.frames)[t] for _ in range(3))
    if scene.tumbles:
        angle = np.random.default_rng([scene.seed, t]).uniform(0, 360)
        target = replace(target, angle=float(angle))
    image = _background(read_cached(scene.background), camera)
    if scene.companion is not None:
        _paste(image, _read_object(scene.companion), companion.moved_with(camera))
    distractors = [
        (
            _read_object(path),
            _near(target, _random_poses(rng, scene.frames)[t], rng).moved_with(camera),
        )
        for path in scene.distractors
    ]
    for cutout, pose in distractors[::2]:
        _paste(image, cutout, pose)
    mask = _paste(image, _read_object(scene.object_path), target.moved_with(camera))
    for cutout, pose in distractors[1::2]:
        mask &= ~_paste(image, cutout, pose)
    image.flags.writeable = False
    return _Frame(image, mask)


@lru_cache(maxsize=_CACHED_OBJECTS)
def _read_object(path: Path) -> Image:
    """A cut-out object (H, W, 4) uint8 BGRA without transparent margins.

    Raises
    ------
    SourceError
        The file is not an image with alpha, or is fully transparent.
    """
    _, image = read_unchanged(path)
    if image is None or image.dtype != np.uint8 or image.shape[2:] != (4,):
        raise SourceError(f"{path}: is not an image with an alpha channel; remove it")
    bgra = np.asarray(image, dtype=np.uint8)
    box = box_of_mask(bgra[..., 3] >= 128)
    if box is None:
        raise SourceError(f"{path}: is fully transparent; remove it")
    x, y, w, h = map(int, box)
    return bgra[y : y + h, x : x + w]


@dataclass(frozen=True, eq=False)
class _Pose:
    """Position, size and lighting of an object in a frame.

    Attributes
    ----------
    position : (float, float)
        Fractions of the frame's width and height.
    size : float
        0..1, from the smallest to the largest.
    shift : (float, float)
        Px from the position, in this frame.
    angle : float
        Degrees.
    growth : float
        Scale factor in this frame.
    gains : (3,) float64
        Factors of blue, green and red.
    mirrored : bool
    """

    position: tuple[float, float]
    size: float
    shift: tuple[float, float]
    angle: float
    growth: float
    gains: Floats
    mirrored: bool

    def moved_with(self, camera: _Pose) -> _Pose:
        """The pose with the camera's shift added."""
        (x, y), (dx, dy) = self.shift, camera.shift
        return replace(self, shift=(x + dx, y + dy))


def _random_poses(rng: np.random.Generator, frames: int) -> list[_Pose]:
    """A random walk of `frames` poses."""
    position, size = rng.uniform(0.15, 0.85, 2), rng.random()
    angle, gains = _ROTATION * rng.normal(), _LIGHT * rng.normal(size=3)
    mirrored = rng.random() < 0.5
    steps = np.cumsum(rng.normal(size=(frames, 5)), axis=0)
    return [
        _Pose(
            position=(float(position[0]), float(position[1])),
            size=float(size),
            shift=(_STEP * float(step[0]), _STEP * float(step[1])),
            angle=angle + _TURN * float(step[2]),
            growth=float(np.exp(_GROWTH * step[3])),
            gains=np.exp(gains / 2 + _FLICKER * step[4]),
            mirrored=bool(mirrored),
        )
        for step in steps
    ]


def _near(target: _Pose, pose: _Pose, rng: np.random.Generator) -> _Pose:
    """The pose of a distractor, moved near the target; it follows the target's motion too."""
    size = float(np.clip(target.size + rng.uniform(-_SIZE_DIFFERENCE, _SIZE_DIFFERENCE), 0, 1))
    distance = rng.uniform(*_DISTANCE) * _long_side(target)
    direction = rng.uniform(0, 2 * np.pi)
    x, y = distance * np.cos(direction), distance * np.sin(direction)
    position = (target.position[0] + x / _SIZE_WH[0], target.position[1] + y / _SIZE_WH[1])
    return replace(pose.moved_with(target), position=position, size=size)


def _background(image: Image, camera: _Pose) -> Image:
    """The frame (480, 640, 3) without objects: a part of an image, reflected at its borders."""
    width, height = _SIZE_WH
    low, high = _VIEW
    scale = (low + (high - low) * camera.size) * min(
        image.shape[1] / width, image.shape[0] / height
    )
    free_x, free_y = image.shape[1] - scale * width, image.shape[0] - scale * height
    left = free_x * camera.position[0] - scale * camera.shift[0]
    top = free_y * camera.position[1] - scale * camera.shift[1]
    image_from_frame = np.array([[scale, 0, left], [0, scale, top]])
    frame = cv2.warpAffine(
        image,
        image_from_frame,
        _SIZE_WH,
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REFLECT_101,
    )
    return _with_gains(np.asarray(frame, dtype=np.uint8), camera.gains)


def _paste(frame: Image, cutout: Image, pose: _Pose) -> Mask:
    """Draw an object (H, W, 4) BGRA into the frame; return the pixels that it mostly covers."""
    mask = np.zeros(frame.shape[:2], dtype=np.bool_)
    cutout, zoom = _reduced(cutout, pose)
    frame_from_cutout = _frame_from_cutout(cutout, pose, zoom)
    x, y, w, h = _extent(frame_from_cutout, cutout)
    if w <= 0 or h <= 0:
        return mask
    frame_from_cutout[:, 2] -= x, y
    layer = cv2.warpAffine(_premultiplied(cutout, pose), frame_from_cutout, (w, h))
    part = np.s_[y : y + h, x : x + w]
    alpha = layer[..., 3:]
    frame[part] = np.rint(layer[..., :3] + frame[part] * (1 - alpha)).clip(0, 255)
    mask[part] = alpha[..., 0] >= 0.5
    return mask


def _reduced(cutout: Image, pose: _Pose) -> tuple[Image, float]:
    """The object reduced to its size in the frame, and the zoom that remains to be applied."""
    zoom = _long_side(pose) / max(cutout.shape[:2])
    if zoom >= 1:
        return cutout, zoom
    small_wh = [max(2, round(zoom * n)) for n in cutout.shape[1::-1]]
    small = cv2.resize(cutout, small_wh, interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8), 1.0


def _long_side(pose: _Pose) -> float:
    smallest, largest = _OBJECT_SIDE
    return float(smallest * (largest / smallest) ** pose.size * pose.growth)


def _premultiplied(cutout: Image, pose: _Pose) -> NDArray[np.float32]:
    """Colors times alpha, so that hidden pixels do not bleed in, and alpha 0..1."""
    layer = _with_gains(cutout, np.append(pose.gains, 1.0)).astype(np.float32)
    layer[..., 3] /= 255
    layer[..., :3] *= layer[..., 3:]
    return layer


def _extent(frame_from_cutout: Floats, cutout: Image) -> tuple[int, int, int, int]:
    """The part x, y, w, h of the frame that an object can cover, px."""
    height, width = cutout.shape[:2]
    corners = np.array([[-1, -1, 1], [width, -1, 1], [width, height, 1], [-1, height, 1]])
    reached = corners @ frame_from_cutout.T
    left, top = np.clip(np.floor(reached.min(axis=0)), 0, _SIZE_WH).astype(int).tolist()
    right, bottom = np.clip(np.ceil(reached.max(axis=0)) + 1, 0, _SIZE_WH).astype(int).tolist()
    return left, top, right - left, bottom - top


def _frame_from_cutout(cutout: Image, pose: _Pose, zoom: float) -> Floats:
    """The transform (2, 3) from px of the object to px of the frame."""
    cos, sin = zoom * np.cos(np.deg2rad(pose.angle)), zoom * np.sin(np.deg2rad(pose.angle))
    cx, cy = (cutout.shape[1] - 1) / 2, (cutout.shape[0] - 1) / 2
    x = pose.position[0] * _SIZE_WH[0] + pose.shift[0]
    y = pose.position[1] * _SIZE_WH[1] + pose.shift[1]
    across = np.array([-cos, -sin]) if pose.mirrored else np.array([cos, sin])
    down = np.array([-sin, cos])
    return np.stack([across, down, (x, y) - cx * across - cy * down], axis=1)


def _with_gains(image: Image, gains: Floats) -> Image:
    levels = np.arange(256)[:, None] * gains
    table = np.rint(levels).clip(0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, table[None]), dtype=np.uint8)
