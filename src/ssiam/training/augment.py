"""Changes of a crop that leave its target where it is: light, colour, blur, artefacts, cover."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import Image

# Standard deviations: log of the contrast, grey levels of brightness, log of every colour's gain,
# log of the saturation, degrees of hue.
_CONTRAST: Final = 0.15
_BRIGHTNESS: Final = 10.0
_CAST: Final = 0.05
_SATURATION: Final = 0.25
_HUE: Final = 8.0
_HUE_CHANCE: Final = 0.3

_BLUR: Final = (0.5, 1.8)  # pixels, standard deviation of a Gaussian
_QUALITY: Final = (25, 80)  # of JPEG, per cent
# Half axes of what covers the target, as shares of its width and height; where its middle lies,
# in half widths and heights from the target's.
_COVER: Final = (0.15, 0.4)
_COVER_AT: Final = (0.4, 1.1)


@dataclass(frozen=True)
class AugmentSettings:
    """How often crops are changed, shares 0..1.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    grey : float
        Both crops without colour.
    flip : float
        Both crops mirrored.
    colour : float
        Each crop in another light: brightness, contrast, cast, saturation, hue.
    blur : float
        Each crop out of focus.
    shake : float
        The search window shifted and its crop blurred as a shaking camera does; the template
        blurred likewise a quarter as often.
    jpeg : float
        Each crop with the artefacts of a compressed video.
    cover : float
        A part of the target behind something else.
    small : float
        Both crops as coarse as those of a target of 12 to 32 pixels.
    """

    grey: float = 0.08
    flip: float = 0.5
    colour: float = 0.7
    blur: float = 0.1
    shake: float = 0.35
    jpeg: float = 0.2
    cover: float = 0.12
    small: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not 0 <= (value := getattr(self, field.name)) <= 1:
                raise ArgumentError(f"{field.name} {value} of crops: give a share from 0 to 1")


def changed(crop: Image, settings: AugmentSettings, rng: np.random.Generator) -> Image:
    """The crop (side, side, 3) uint8 BGR in other light, blurred or with artefacts, by chance."""
    if rng.random() < settings.blur:
        crop = _defocused(crop, rng)
    if rng.random() < settings.colour:
        crop = _relit(crop, rng)
    if rng.random() < settings.jpeg:
        crop = _compressed(crop, rng)
    return crop


def coarsened(crop: Image, factor: float) -> Image:
    """The crop (side, side, 3) as it is of a target that is `factor` times as small."""
    side = crop.shape[0]
    few = max(round(side / factor), 2)
    small = cv2.resize(crop, (few, few), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, (side, side)), dtype=np.uint8)


def greyed(crop: Image) -> Image:
    """The crop without colour, in three equal channels."""
    grey = cv2.cvtColor(crop, cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


def covered(
    crop: Image, target: NDArray[np.float64], rng: np.random.Generator
) -> tuple[Image, NDArray[np.bool_]]:
    """The crop with an ellipse of its own texture over a part of the target, and where that is.

    `target` (4,) is the box: centre from the crop's middle, width, height. The ellipse hides at
    most about two fifths of it.
    """
    size = target[2:]
    side = rng.uniform(-np.pi, np.pi)
    towards = np.array([np.cos(side), np.sin(side)]) * size / 2
    middle = (crop.shape[0] - 1) / 2 + target[:2] + towards * rng.uniform(*_COVER_AT)
    axes = np.maximum(size * rng.uniform(*_COVER, 2), 1)
    canvas = np.zeros(crop.shape[:2], dtype=np.uint8)
    x, y = np.rint(np.clip(middle, -1e4, 1e4)).astype(int).tolist()
    across, down = np.rint(np.clip(axes, 1, 1e4)).astype(int).tolist()
    cv2.ellipse(canvas, (x, y), (across, down), rng.uniform(0, 180), 0, 360, (1,), -1)
    cover = canvas.astype(np.bool_)
    moved = np.roll(crop, rng.integers(64, 192, 2), axis=(0, 1))
    return np.where(cover[..., None], moved, crop), cover


def _relit(crop: Image, rng: np.random.Generator) -> Image:
    contrast, brightness, *cast = rng.normal(size=5)
    gains = np.exp(_CONTRAST * contrast + _CAST * np.array(cast))
    levels = (np.arange(256)[:, None] - 128) * gains + 128 + _BRIGHTNESS * brightness
    table = np.rint(levels).clip(0, 255).astype(np.uint8)
    crop = np.asarray(cv2.LUT(crop, table[None]), dtype=np.uint8)
    if rng.random() < _HUE_CHANCE:
        crop = _rehued(crop, _HUE * rng.normal())
    share = float(np.exp(_SATURATION * (rng.normal() - 0.5)))
    mixed = cv2.addWeighted(crop, share, greyed(crop), 1 - share, 0)
    return np.asarray(mixed, dtype=np.uint8)


def _rehued(crop: Image, degrees: float) -> Image:
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
