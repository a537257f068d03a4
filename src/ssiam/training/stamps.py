"""Stamps: pictures of objects cut out (PNGs with alpha), pasted on any background picture.

A scene is a few frames in which the object, the camera and the light change a little; masks are
exact. Every stamp is pasted several times, each time elsewhere and on another picture. Rivals are
other stamps of about its size that go beside it, behind or in front: of a set of people, people.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from ssiam.training.stamp_scenes import backdrop, beside, paste, poses

_FRAMES = 3
_PASTED = 32  # scenes of every stamp
_COMPANY = 0.4  # chance of another stamp in the scene, behind
_RIVALS = 3  # at most
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
    rivals : tuple of Path
        Other stamps beside it, every second one in front.
    tumbles : bool
        It shows at any angle, another one in each frame.
    seed : int
        Another seed is another place, size, light and motion.
    frames : int
    """

    stamp: Path
    background: Path
    other: Path | None = None
    rivals: tuple[Path, ...] = ()
    tumbles: bool = False
    seed: int = 0
    frames: int = _FRAMES

    @property
    def shows(self) -> tuple[str, ...]:
        """The paths of the stamps and of the background."""
        paths = (self.stamp, self.background, self.other, *self.rivals)
        return tuple(str(path) for path in paths if path)

    def image(self, t: int) -> Image:
        """The picture of a frame, 640x480."""
        return _rendered(self, t).image

    def box(self, t: int) -> XYWH | None:
        """The box around what is seen of the stamp."""
        return box_of_mask(self.mask(t))

    def mask(self, t: int) -> Mask:
        """Where the stamp covers at least half of a pixel, and no rival does."""
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
    rivals : float
        Share 0..1 of the scenes that have one to three rivals.
    tumbling : float
        Share 0..1 of the scenes in which the stamp tumbles.
    """

    name: str
    stamps: tuple[Path, ...]
    backgrounds: tuple[Path, ...]
    weight: float = 1.0
    alike: bool = False
    rivals: float = 0.0
    tumbling: float = 0.0

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
        seed = int(rng.integers(1 << 31))
        rivals = self._rivals(stamp, rng) if rng.random() < self.rivals else ()
        tumbles = bool(rng.random() < self.tumbling)
        return StampScene(stamp, background, None if alone else other, rivals, tumbles, seed)

    def _rivals(self, stamp: Path, rng: np.random.Generator) -> tuple[Path, ...]:
        drawn = rng.integers(len(self.stamps), size=rng.integers(1, _RIVALS + 1))
        return tuple(self.stamps[i] for i in drawn if self.stamps[i] != stamp)

    def beside(self, i: int) -> Sequence[int]:
        """None: the pictures of the stamp's other scenes are others."""
        return ()


@lru_cache(maxsize=_KEPT)
def _rendered(scene: StampScene, t: int) -> _Frame:
    rng = np.random.default_rng(scene.seed)
    camera, target, companion = (poses(rng, scene.frames)[t] for _ in range(3))
    if scene.tumbles:
        angle = np.random.default_rng([scene.seed, t]).uniform(0, 360)
        target = replace(target, angle=float(angle))
    image = backdrop(picture(scene.background), camera)
    if scene.other is not None:
        paste(image, _stamp(scene.other), companion.seen_by(camera))
    rivals = [
        (_stamp(path), beside(target, poses(rng, scene.frames)[t], rng).seen_by(camera))
        for path in scene.rivals
    ]
    for rival, pose in rivals[::2]:
        paste(image, rival, pose)
    mask = paste(image, _stamp(scene.stamp), target.seen_by(camera))
    for rival, pose in rivals[1::2]:
        mask &= ~paste(image, rival, pose)
    image.flags.writeable = False
    return _Frame(image, mask)


@lru_cache(maxsize=4 * _KEPT)
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
