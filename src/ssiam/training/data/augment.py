"""Augmentations of crops that do not move the target: color, blur, occlusion, camera shake."""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import ShakeKind
from ssiam.datasets.shake.path import sample_path
from ssiam.geometry import Image, Transform
from ssiam.training.data.settings import AugmentSettings

__all__ = [
    "NO_SHAKE",
    "Shake",
    "augment_crop",
    "coarsen",
    "draw_shake",
    "motion_blur",
    "occlude",
    "to_grayscale",
]

# Standard deviations of the color changes.
_CONTRAST: Final = 0.15  # log
_BRIGHTNESS: Final = 10.0  # gray levels
_CAST: Final = 0.05  # log of each channel's gain
_SATURATION: Final = 0.25  # log
_HUE: Final = 8.0  # degrees
_HUE_PROBABILITY: Final = 0.3

_BLUR: Final = (0.5, 1.8)  # px, standard deviation of the Gaussian
_QUALITY: Final = (25, 80)  # of JPEG, percent
# Half axes of an occluder, as fractions of the target's size; distance of its center from the
# target's, in half widths and heights.
_OCCLUDER: Final = (0.15, 0.4)
_OCCLUDER_DISTANCE: Final = (0.4, 1.1)

_SHAKE_KINDS: Final[tuple[tuple[ShakeKind, float], ...]] = (  # with their probabilities
    ("handheld", 0.4),
    ("vibration", 0.25),
    ("gusts", 0.15),
    ("white", 0.2),
)
_SHAKE_STRENGTHS: Final = (0.004, 0.03)  # fractions of the frame width
_EXPOSURES: Final = (0.1, 0.9)  # fractions of the frame interval
_INSTANTS: Final = 24  # sampled during an exposure
_MAX_BLUR: Final = 20.0  # px of the crop, the largest distance from the middle of a trail
_MIN_BLUR: Final = 0.7  # px of the crop; shorter trails are ignored

Floats: TypeAlias = NDArray[np.float64]


def augment_crop(crop: Image, settings: AugmentSettings, rng: np.random.Generator) -> Image:
    """Apply random blur, color change and JPEG compression to a crop (side, side, 3) uint8 BGR."""
    if rng.random() < settings.blur:
        crop = _defocused(crop, rng)
    if rng.random() < settings.colour:
        crop = _color_changed(crop, rng)
    if rng.random() < settings.jpeg:
        crop = _compressed(crop, rng)
    return crop


def coarsen(crop: Image, factor: float) -> Image:
    """The crop (side, side, 3) at the resolution of a target that is `factor` times smaller."""
    side = crop.shape[0]
    small_side = max(round(side / factor), 2)
    small = cv2.resize(crop, (small_side, small_side), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, (side, side)), dtype=np.uint8)


def to_grayscale(crop: Image) -> Image:
    """The crop (side, side, 3) in gray, as three equal channels."""
    gray = cv2.cvtColor(crop, cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


def occlude(
    crop: Image, target: NDArray[np.float64], rng: np.random.Generator
) -> tuple[Image, NDArray[np.bool_]]:
    """Cover a part of the target with an ellipse, textured from elsewhere in the crop.

    Parameters
    ----------
    crop : (side, side, 3) uint8 BGR
    target : (4,) float64
        cx, cy, w, h, px of the crop from its middle pixel.
    rng : Generator

    Returns
    -------
    crop : (side, side, 3) uint8 BGR
    occluded : (side, side) bool
        The ellipse, which covers at most about two fifths of the target.
    """
    size = target[2:]
    direction = rng.uniform(-np.pi, np.pi)
    offset = np.array([np.cos(direction), np.sin(direction)]) * size / 2
    middle = (crop.shape[0] - 1) / 2 + target[:2] + offset * rng.uniform(*_OCCLUDER_DISTANCE)
    axes = np.maximum(size * rng.uniform(*_OCCLUDER, 2), 1)
    canvas = np.zeros(crop.shape[:2], dtype=np.uint8)
    x, y = np.rint(np.clip(middle, -1e4, 1e4)).astype(int).tolist()
    across, down = np.rint(np.clip(axes, 1, 1e4)).astype(int).tolist()
    cv2.ellipse(canvas, (x, y), (across, down), rng.uniform(0, 180), 0, 360, (1,), -1)
    occluded = canvas.astype(np.bool_)
    texture = np.roll(crop, rng.integers(64, 192, 2), axis=(0, 1))
    return np.where(occluded[..., None], texture, crop), occluded


def _color_changed(crop: Image, rng: np.random.Generator) -> Image:
    contrast, brightness, *cast = rng.normal(size=5)
    gains = np.exp(_CONTRAST * contrast + _CAST * np.array(cast))
    levels = (np.arange(256)[:, None] - 128) * gains + 128 + _BRIGHTNESS * brightness
    table = np.rint(levels).clip(0, 255).astype(np.uint8)
    crop = np.asarray(cv2.LUT(crop, table[None]), dtype=np.uint8)
    if rng.random() < _HUE_PROBABILITY:
        crop = _hue_shifted(crop, _HUE * rng.normal())
    saturation = float(np.exp(_SATURATION * (rng.normal() - 0.5)))
    mixed = cv2.addWeighted(crop, saturation, to_grayscale(crop), 1 - saturation, 0)
    return np.asarray(mixed, dtype=np.uint8)


def _hue_shifted(crop: Image, degrees: float) -> Image:
    hsv = cv2.cvtColor(crop, cv2.COLOR_BGR2HSV)
    # OpenCV's hue has 180 steps.
    table = ((np.arange(256) + round(degrees / 2)) % 180).astype(np.uint8)
    hsv[..., 0] = table[hsv[..., 0]]
    return np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR), dtype=np.uint8)


def _defocused(crop: Image, rng: np.random.Generator) -> Image:
    return np.asarray(cv2.GaussianBlur(crop, (0, 0), rng.uniform(*_BLUR)), dtype=np.uint8)


def _compressed(crop: Image, rng: np.random.Generator) -> Image:
    quality = int(rng.integers(*_QUALITY))
    _, data = cv2.imencode(".jpg", crop, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)


class Shake(NamedTuple):
    """Effect of a camera shake on a point of one frame.

    Attributes
    ----------
    step_xy : (2,) float64
        Motion of the point since the last frame, px of the frame.
    trail : (N, 2) float64
        Its path during the exposure, relative to the mean of the path; px of the frame.
    """

    step_xy: Floats
    trail: Floats


NO_SHAKE: Final = Shake(np.zeros(2), np.zeros((1, 2)))


def draw_shake(
    point_xy: tuple[float, float], size_wh: tuple[int, int], rng: np.random.Generator
) -> Shake:
    """A random camera shake, evaluated at a point of a frame of (width, height) px.

    The camera paths are those on which trackers are evaluated (`ssiam.datasets.shake.path`):
    hand-held, vibration, gusts, white noise.
    """
    kinds, probabilities = zip(*_SHAKE_KINDS, strict=True)
    kind: ShakeKind = kinds[rng.choice(len(kinds), p=probabilities)]
    strength = float(np.exp(rng.uniform(*np.log(_SHAKE_STRENGTHS))))
    exposure = rng.uniform(*_EXPOSURES)
    path = sample_path(kind, strength, int(rng.integers(1 << 31)), 2, size_wh, "")
    times = exposure * ((np.arange(_INSTANTS) + 0.5) / _INSTANTS - 0.5)
    points = path.at(times + np.array([[0.0], [1.0]])) @ np.array([*point_xy, 1.0])
    before, now = points[..., :2]
    return Shake(now.mean(axis=0) - before.mean(axis=0), now - now.mean(axis=0))


def motion_blur(crop: Image, trail: Floats, crop_from_frame: Transform) -> Image:
    """Blur a crop (side, side, 3) along a trail (N, 2), px of the frame, around its mean."""
    offsets = trail @ crop_from_frame[:2, :2].T
    longest = float(np.abs(offsets).max())
    if longest < _MIN_BLUR:
        return crop
    kernel = _blur_kernel(offsets * min(1.0, _MAX_BLUR / longest))
    return np.asarray(
        cv2.filter2D(crop, -1, kernel, borderType=cv2.BORDER_REPLICATE), dtype=np.uint8
    )


def _blur_kernel(offsets: Floats) -> NDArray[np.float32]:
    """Fraction of the exposure (2 r + 1, 2 r + 1) at each offset of the content."""
    radius = int(np.ceil(np.abs(offsets).max())) + 1
    # `filter2D` correlates: a pixel gets the value at the kernel's offset, hence the sign.
    points = radius - offsets
    low = np.floor(points).astype(int)
    right, below = (points - low).T
    kernel = np.zeros((2 * radius + 1, 2 * radius + 1), dtype=np.float32)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = np.abs(1 - dx - right) * np.abs(1 - dy - below)
        np.add.at(kernel, (low[:, 1] + dy, low[:, 0] + dx), weight)
    return np.asarray(kernel / kernel.sum())
