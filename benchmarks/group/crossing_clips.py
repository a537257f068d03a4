"""Clips of two targets that cross: real ones of annotated objects, and drawn ones.

A real clip is a part of a clip in MOTChallenge's layout in which two objects pass each other. It is
also used from its last frame to its first. In a drawn clip two blobs of similar texture move over a
background of noise. A drawn clip depends only on its seed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.data import read_bgr
from ssiam.datasets.mot import MotClip, read_clip
from ssiam.geometry import Image, iou

Floats = NDArray[np.float64]

# Of real clips.
MIN_OVERLAP = 0.25  # maximum IoU of the two objects' boxes
TOUCH = 0.05  # IoU from which two objects touch each other
MARGIN = 25  # frames before and after the contact
MIN_MARGIN = 2
MAX_SIZE_RATIO = 2.5  # of the two targets' sides
MIN_SIDE = 6.0  # px

# Of drawn clips.
SIZE_WH = (320, 240)
FRAMES = 70
KINSHIP = 0.5  # share of the texture that both targets have in common
NOISE = 3.0  # gray levels


@dataclass(frozen=True, eq=False)
class CrossingClip:
    """A clip in which two targets cross.

    Attributes
    ----------
    name : str
    frames : callable
        Returns a new iterator over the frames.
    truth : (2, N, 4) float64
        True boxes x, y, w, h of both targets; nan in frames without an annotation.
    """

    name: str
    frames: Callable[[], Iterator[Image]]
    truth: Floats


def real_clips(folder: Path) -> list[CrossingClip]:
    """All crossings in a clip of MOTChallenge's layout, forward and backward."""
    clip = read_clip(folder, as_published=True)
    count = len(clip.paths(0))
    clips = []
    for one, other in combinations(clip.objects, 2):
        truth = np.stack([each.boxes(0, count) for each in (one, other)])
        part = _crossing(truth)
        if part is None:
            continue
        name = f"{clip.name} {one.number} and {other.number}"
        order = range(*part)
        clips += [
            _real(f"{name}{suffix}", clip, truth, indices)
            for suffix, indices in (("", order), (" backward", order[::-1]))
        ]
    return clips


def _real(name: str, clip: MotClip, truth: Floats, indices: range) -> CrossingClip:
    paths = clip.paths(0)
    return CrossingClip(
        name, lambda: (read_bgr(paths[index]) for index in indices), truth[:, list(indices)]
    )


def _crossing(truth: Floats) -> tuple[int, int] | None:
    """First frame and end of the part in which two objects (2, N, 4) cross; None if they do not."""
    visible = np.isfinite(truth).all(axis=(0, 2))
    if visible.sum() < 2 * MIN_MARGIN:
        return None
    overlap = np.where(visible, np.nan_to_num(iou(truth[0], truth[1])), 0.0)
    peak = int(overlap.argmax())
    sides = np.sqrt(truth[:, peak, 2] * truth[:, peak, 3])
    if (
        overlap[peak] < MIN_OVERLAP
        or sides.max() > MAX_SIZE_RATIO * sides.min()
        or np.nanmin(truth[:, visible, 2:]) < MIN_SIDE
    ):
        return None
    apart = np.flatnonzero(visible & (overlap < TOUCH))
    before, after = apart[apart < peak], apart[apart > peak]
    if len(before) < MIN_MARGIN or len(after) < MIN_MARGIN:
        return None
    first = before[before >= before[-1] - MARGIN][0]
    last = after[after <= after[0] + MARGIN][-1]
    centers = truth[..., 0] + truth[..., 2] / 2
    side = np.sign(centers[0] - centers[1])
    return (int(first), int(last) + 1) if side[first] != side[last] else None


@dataclass(frozen=True, eq=False)
class _Blob:
    """A drawn object.

    Attributes
    ----------
    picture : (h, w, 3) uint8
    mask : (h, w) float32
        Opacity, 0..1.
    path : (N, 2) float64
        Centers, pixels.
    scale : (N,) float64
    angle : (N,) float64
        Degrees.
    """

    picture: Image
    mask: NDArray[np.float32]
    path: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    scale: Floats = field(default_factory=lambda: np.zeros(0))
    angle: Floats = field(default_factory=lambda: np.zeros(0))

    def boxes(self) -> Floats:
        """Boxes (N, 4) of the blob on its path."""
        h, w = self.mask.shape
        size = self.scale[:, None] * (0.9 * w, 0.9 * h)  # the mask fades out at its border
        return np.hstack([self.path - size / 2, size])

    def paint(self, image: Image, index: int) -> None:
        """Paint the blob of one frame over an image."""
        h, w = self.mask.shape
        image_from_blob = cv2.getRotationMatrix2D(
            ((w - 1) / 2, (h - 1) / 2), float(self.angle[index]), float(self.scale[index])
        )
        image_from_blob[:, 2] += self.path[index] - (w / 2, h / 2)
        size_wh = image.shape[1], image.shape[0]
        picture = cv2.warpAffine(
            self.picture, image_from_blob, size_wh, borderMode=cv2.BORDER_REPLICATE
        )
        mask = cv2.warpAffine(self.mask, image_from_blob, size_wh)[..., None]
        image[:] = np.rint(picture * mask + image * (1 - mask)).astype(np.uint8)


def drawn_clip(seed: int) -> CrossingClip:
    """A clip of two drawn objects that cross; the second one passes in front."""
    rng = np.random.default_rng([seed, 27])
    side = rng.uniform(28, 48)
    shape_wh = int(side * rng.uniform(0.7, 1.0)), int(side * rng.uniform(1.0, 1.5))
    color, common = rng.uniform(50, 200, 3), _noise(rng, shape_wh, 5)
    blobs = [_blob(rng, shape_wh, color, common) for _ in range(2)]
    back, front = _crossing_paths(rng, blobs, shape_wh)
    width, height = SIZE_WH
    gray = _noise(rng, (2 * width, 2 * height), 12).mean(axis=2, keepdims=True)
    background = gray * 30 + rng.uniform(70, 180, 3)
    drift = np.cumsum(rng.normal(0, 0.6, (FRAMES, 2)), axis=0) + np.divide(SIZE_WH, 2)
    wide = np.clip(background, 0, 255).astype(np.uint8)
    frames = partial(_drawn_frames, wide, drift, (back, front), seed)
    return CrossingClip(f"drawn {seed}", frames, np.stack([back.boxes(), front.boxes()]))


def _noise(rng: np.random.Generator, size_wh: tuple[int, int], grain: int) -> Floats:
    """Smooth noise (h, w, 3) of mean 0 and deviation 1, of the given grain and finer, pixels."""
    w, h = size_wh
    total = np.zeros((h, w, 3))
    for step in (4 * grain, 2 * grain, grain):
        coarse = rng.normal(0, 1, (h // step + 3, w // step + 3, 3))
        total += cv2.resize(coarse, (w, h), interpolation=cv2.INTER_CUBIC)
    return np.asarray((total - total.mean()) / total.std())


def _blob(
    rng: np.random.Generator, size_wh: tuple[int, int], color: Floats, common: Floats
) -> _Blob:
    w, h = size_wh
    own = _noise(rng, size_wh, 5)
    texture = KINSHIP * common + (1 - KINSHIP) * own
    y, x = np.mgrid[0:h, 0:w]
    radius = np.hypot((x + 0.5) / w * 2 - 1, (y + 0.5) / h * 2 - 1)
    mask = np.clip((1 - radius) * 6, 0, 1).astype(np.float32)
    return _Blob(np.clip(color + 60 * texture, 0, 255).astype(np.uint8), mask)


def _crossing_paths(
    rng: np.random.Generator, blobs: list[_Blob], size_wh: tuple[int, int]
) -> list[_Blob]:
    """The blobs on paths that meet in the middle of the clip."""
    time = np.linspace(-1, 1, FRAMES)
    meeting = np.array(SIZE_WH) / 2 + rng.uniform(-15, 15, 2)
    direction = rng.uniform(0, math.tau)
    turn = direction + rng.uniform(math.pi / 3, math.pi) * rng.choice((-1, 1))
    moving = []
    for blob, angle in zip(blobs, (direction, turn), strict=True):
        reach = rng.uniform(55, 85)
        if blob is blobs[1] and rng.random() < 0.3:
            reach = rng.uniform(5, 15)  # it almost stands
        wobble = 3 * np.sin(time[:, None] * rng.uniform(3, 8) + rng.uniform(0, 6, 2))
        way = reach * time[:, None] * (math.cos(angle), 0.8 * math.sin(angle))
        offset = rng.uniform(-0.15, 0.15, 2) * size_wh
        moving.append(
            replace(
                blob,
                path=meeting + offset + way + wobble,
                scale=1 + 0.08 * np.sin(time * rng.uniform(2, 5) + rng.uniform(0, 6)),
                angle=rng.uniform(3, 10) * np.sin(time * rng.uniform(3, 8) + rng.uniform(0, 6)),
            )
        )
    return moving


def _drawn_frames(
    wide: Image, drift: Floats, blobs: tuple[_Blob, _Blob], seed: int
) -> Iterator[Image]:
    rng = np.random.default_rng([seed, 28])
    width, height = SIZE_WH
    for index, (x, y) in enumerate(drift.tolist()):
        scene = cv2.getRectSubPix(wide, SIZE_WH, (x + width / 2, y + height / 2))
        image = np.asarray(scene, np.uint8).copy()
        for blob in blobs:
            blob.paint(image, index)
        noisy = image + rng.normal(0, NOISE, image.shape)
        yield np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
