"""Stamps: pictures of objects cut out (PNGs with alpha), pasted on any background picture.

A scene is a few frames in which the object, the camera and the light change a little; masks are
exact. Every stamp is pasted several times, each time elsewhere and on another picture.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from ssiam.errors import SourceError
from ssiam.geometry import XYWH, Image
from ssiam.training.outlines import box_of_mask
from ssiam.training.pictures import picture
from ssiam.training.sources import Mask
from ssiam.training.stamp_scenes import backdrop, paste, poses

_FRAMES = 3
_PASTED = 32  # scenes of every stamp
_COMPANY = 0.4  # chance of another stamp in the scene, behind
_KEPT = 4
_CHANNELS = 4


class _Frame(NamedTuple):
    image: Image
    mask: Mask


@dataclass(frozen=True)
class StampScene:
    """A track of a stamp on a background.

    Attributes
    ----------
    stamp, background : Path
    other : Path, optional
        Another stamp, behind it.
    seed : int
        Another seed is another place, size, light and motion.
    frames : int
    """

    stamp: Path
    background: Path
    other: Path | None = None
    seed: int = 0
    frames: int = _FRAMES

    @property
    def shows(self) -> tuple[str, ...]:
        """The paths of the stamps and of the background."""
        return tuple(str(path) for path in (self.stamp, self.background, self.other) if path)

    def image(self, t: int) -> Image:
        """The picture of a frame, 640x480."""
        return _rendered(self, t).image

    def box(self, t: int) -> XYWH | None:
        """The box around what is seen of the stamp."""
        return box_of_mask(self.mask(t))

    def mask(self, t: int) -> Mask:
        """Where the stamp covers at least half of a pixel."""
        return _rendered(self, t).mask


@dataclass(frozen=True, eq=False)
class StampSource:
    """A `Source` of stamps on backgrounds.

    Attributes
    ----------
    name : str
    stamps, backgrounds : tuple of Path
    weight : float
    alike : bool
        Whether there may be two stamps of the same object.
    """

    name: str
    stamps: tuple[Path, ...]
    backgrounds: tuple[Path, ...]
    weight: float = 1.0
    alike: bool = False

    def __len__(self) -> int:
        """Number of scenes."""
        return _PASTED * len(self.stamps)

    def track(self, i: int) -> StampScene:
        """The scene of an index."""
        stamp = self.stamps[i % len(self.stamps)]
        rng = np.random.default_rng([i, zlib.crc32(self.name.encode())])
        background = self.backgrounds[rng.integers(len(self.backgrounds))]
        other = self.stamps[rng.integers(len(self.stamps))]
        alone = other == stamp or rng.random() >= _COMPANY
        return StampScene(stamp, background, None if alone else other, int(rng.integers(1 << 31)))

    def beside(self, i: int) -> Sequence[int]:
        """None: the pictures of the stamp's other scenes are others."""
        return ()


@lru_cache(maxsize=_KEPT)
def _rendered(scene: StampScene, t: int) -> _Frame:
    rng = np.random.default_rng(scene.seed)
    camera, target, companion = (poses(rng, scene.frames)[t] for _ in range(3))
    image = backdrop(picture(scene.background), camera)
    if scene.other is not None:
        paste(image, _stamp(scene.other), companion.seen_by(camera))
    mask = paste(image, _stamp(scene.stamp), target.seen_by(camera))
    image.flags.writeable = False
    return _Frame(image, mask)


@lru_cache(maxsize=2 * _KEPT)
def _stamp(path: Path) -> Image:
    """A stamp (H, W, 4) uint8 BGRA, cut to what is not transparent; `SourceError` if none."""
    try:
        encoded = np.fromfile(path, dtype=np.uint8)
        image = cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED) if encoded.size else None
    except (OSError, cv2.error):
        image = None
    if image is None or image.dtype != np.uint8 or image.shape[2:] != (_CHANNELS,):
        raise SourceError(f"{path}: is no picture with transparency, as a stamp is; remove it")
    box = box_of_mask(image[..., 3] >= 128)
    if box is None:
        raise SourceError(f"{path}: is wholly transparent; remove it")
    x, y, w, h = map(int, box)
    return np.asarray(image[y : y + h, x : x + w], dtype=np.uint8)
