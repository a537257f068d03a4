"""`Levels`: values of more than 8 bits, as of thermal cameras, shown in 8 by one rule.

The high byte of a 16-bit value tells next to nothing where a scene fills a small part of the
range. One stretch holds for the whole sequence: with one for each frame a target would change its
brightness whenever something hot comes into view.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError, SourceError
from ssiam.geometry import Image
from ssiam.video.frames import DeepPicture, DeepPictures, Picture, Pictures, SourceFacts

# Frames of a recording that the levels are taken from; of live sources the first.
LEVEL_FRAMES = 8
# Percentiles that count as darkest and brightest, and the share of the range between them that is
# left free on both sides, for what comes later.
_LOW_PERCENT, _HIGH_PERCENT, _MARGIN = 0.1, 99.9, 0.05
# Pixels of a frame that are looked at, about.
_SAMPLES = 20_000
# Whole values; a frame with fewer between its percentiles shows nothing, as a closed shutter.
_LEAST_RANGE = 8
# What a frame that shows nothing becomes.
_NOTHING = 128


@dataclass(frozen=True)
class Levels:
    """The values that become 0 and 255; `ArgumentError` if there is nothing between them."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ArgumentError(
                f"levels {self.low:g},{self.high:g}: give two values, the darker one first, "
                "such as 7000,8500"
            )

    def applied(self, image: NDArray[Any]) -> Image:
        """(H, W, 3) uint8 BGR of a (H, W) or (H, W, 3) image of any depth; 8 bits stay."""
        if image.dtype != np.uint8:
            image = self._stretched(image)
        return np.asarray(
            cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image, dtype=np.uint8
        )

    def _stretched(self, image: NDArray[Any]) -> NDArray[np.uint8]:
        if image.dtype != np.uint16:
            return self._scaled(image)
        table = self._scaled(np.arange(1 << 16, dtype=np.float32))
        return np.asarray(table[image], dtype=np.uint8)

    def _scaled(self, values: NDArray[Any]) -> NDArray[np.uint8]:
        shares = (values.astype(np.float32) - self.low) * (255 / (self.high - self.low))
        return np.asarray(np.clip(np.nan_to_num(shares) + 0.5, 0, 255), dtype=np.uint8)


def in_eight_bits(image: NDArray[Any], levels: Levels | None) -> Image:
    """(H, W, 3) uint8 BGR; mid-gray if the image is deeper and there are no levels for it."""
    if levels is None and image.dtype != np.uint8:
        return np.full((*image.shape[:2], 3), _NOTHING, np.uint8)
    return (levels or _ANY).applied(image)


def levels_of(images: Iterable[NDArray[Any]]) -> Levels | None:
    """Levels for a sequence that begins with `images`; None if all of them show nothing.

    Those of 8 bits do not count, nor those that show nothing.
    """
    sampled = [_sampled(image) for image in images if image.dtype != np.uint8]
    shown = [samples for samples in sampled if _range_of(samples) is not None]
    found = _range_of(np.concatenate(shown)) if shown else None
    if found is None:
        return None
    low, high = found
    margin = _MARGIN * (high - low)
    return Levels(low - margin, high + margin)


def _range_of(samples: NDArray[Any]) -> tuple[float, float] | None:
    """Darkest and brightest of some values, without outliers; None if they are as good as one."""
    if not samples.size:
        return None
    low, high = (float(value) for value in np.percentile(samples, (_LOW_PERCENT, _HIGH_PERCENT)))
    is_whole = np.issubdtype(samples.dtype, np.integer)
    shows_nothing = high - low < _LEAST_RANGE if is_whole else high <= low
    return None if shows_nothing else (low, high)


def _sampled(image: NDArray[Any]) -> NDArray[Any]:
    step = max(1, math.isqrt(image.shape[0] * image.shape[1] // _SAMPLES))
    values = image[::step, ::step].ravel()
    return np.asarray(values[np.isfinite(values)])


def eight_bit(
    name: str,
    pictures: DeepPictures,
    facts: SourceFacts,
    levels: Levels | None = None,
    frames: int = LEVEL_FRAMES,
) -> Pictures:
    """The pictures in 8 bits; without `levels` they are taken from the first `frames` deep ones.

    Frames that show nothing are mid-gray until one comes from which levels can be taken.
    """
    stretch = _Stretch(facts, levels, frames)
    with closing(pictures):
        try:
            for time, image in pictures:
                if levels is not None and image.dtype == np.uint8:
                    raise SourceError(
                        f"{name}: has 8 bits a value already; leave out the levels "
                        f"{levels.low:g},{levels.high:g}"
                    )
                yield from stretch.taken((time, image))
        except Exception:
            yield from stretch.rest()
            raise
        yield from stretch.rest()


class _Stretch:
    """Holds deep pictures back until their levels are known."""

    def __init__(self, facts: SourceFacts, levels: Levels | None, frames: int) -> None:
        self._facts = facts
        self._levels = levels
        self._frames = frames
        self._held: list[DeepPicture] = []

    def taken(self, picture: DeepPicture) -> list[Picture]:
        """The pictures that are ready with this one."""
        time, image = picture
        if self._levels is not None or (image.dtype == np.uint8 and not self._held):
            return [(time, in_eight_bits(image, self._levels))]
        self._held.append(picture)
        return self.rest() if len(self._held) >= self._frames else []

    def rest(self) -> list[Picture]:
        """The pictures held back."""
        held, self._held = self._held, []
        if not held:
            return []
        self._levels = levels_of(image for _, image in held)
        if self._levels is not None:
            shown = f"{self._levels.low:.5g},{self._levels.high:.5g}"
            self._facts.remarks.append(
                f"has more than 8 bits a value: shown as with --levels {shown}"
            )
        return [(time, in_eight_bits(image, self._levels)) for time, image in held]


# For images that have 8 bits.
_ANY = Levels(0, 255)
