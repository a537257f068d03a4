"""`Levels`: scales images of more than 8 bits per value, as from thermal cameras, to 8 bits.

Dropping the low byte of 16 bits is not enough: a scene often fills only a small part of the range.
All frames of a source are scaled with the same pair of levels. With levels per frame, the
brightness of a target would change whenever something hot comes into view.
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
from ssiam.video.frames import (
    DecodedImage,
    DecodedImages,
    SourceInfo,
    TimedImage,
    TimedImages,
)

# Frames from which the levels of a recording are estimated; live sources use the first one.
LEVEL_FRAMES = 8
# Percentiles that are used as the darkest and brightest value, and the share of the range between
# them that is added on both sides, for later frames with a larger range.
_LOW_PERCENT, _HIGH_PERCENT, _MARGIN = 0.1, 99.9, 0.05
# Approximate number of pixels sampled from a frame.
_SAMPLES = 20_000
# Integer frames with a smaller range between the percentiles have no content (closed shutter).
_LEAST_RANGE = 8
# Gray value of frames without content.
_MID_GRAY = 128


@dataclass(frozen=True)
class Levels:
    """The values that become 0 and 255; `ArgumentError` unless ``low < high``, both finite."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise ArgumentError(
                f"levels {self.low:g},{self.high:g}: give two values, the darker one first, "
                "such as 7000,8500"
            )

    def apply(self, image: NDArray[Any]) -> Image:
        """Convert an (H, W) or (H, W, 3) image to (H, W, 3) uint8 BGR; uint8 values are kept."""
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


# For images of 8 bits, which `Levels.apply` does not scale.
_UNUSED_LEVELS = Levels(0, 255)


def to_8bit(image: NDArray[Any], levels: Levels | None) -> Image:
    """(H, W, 3) uint8 BGR; mid-gray if the image has more than 8 bits and `levels` is None."""
    if levels is None and image.dtype != np.uint8:
        return np.full((*image.shape[:2], 3), _MID_GRAY, np.uint8)
    return (levels or _UNUSED_LEVELS).apply(image)


def find_levels(images: Iterable[NDArray[Any]]) -> Levels | None:
    """Levels for a sequence that begins with `images`; None if none of them has content.

    Images of 8 bits and images without content are ignored.
    """
    sampled = [_samples(image) for image in images if image.dtype != np.uint8]
    with_content = [samples for samples in sampled if _range_of(samples) is not None]
    found = _range_of(np.concatenate(with_content)) if with_content else None
    if found is None:
        return None
    low, high = found
    margin = _MARGIN * (high - low)
    return Levels(low - margin, high + margin)


def _range_of(samples: NDArray[Any]) -> tuple[float, float] | None:
    """Darkest and brightest value without outliers; None if they hardly differ."""
    if not samples.size:
        return None
    low, high = (float(value) for value in np.percentile(samples, (_LOW_PERCENT, _HIGH_PERCENT)))
    is_whole = np.issubdtype(samples.dtype, np.integer)
    is_flat = high - low < _LEAST_RANGE if is_whole else high <= low
    return None if is_flat else (low, high)


def _samples(image: NDArray[Any]) -> NDArray[Any]:
    step = max(1, math.isqrt(image.shape[0] * image.shape[1] // _SAMPLES))
    values = image[::step, ::step].ravel()
    return np.asarray(values[np.isfinite(values)])


def convert_to_8bit(
    name: str,
    images: DecodedImages,
    info: SourceInfo,
    levels: Levels | None = None,
    frames: int = LEVEL_FRAMES,
) -> TimedImages:
    """The images of a source in 8 bits.

    Without `levels` they are estimated from the first `frames` images of more than 8 bits. Images
    without content are mid-gray until levels can be estimated.

    Raises
    ------
    SourceError
        `levels` are given for images of 8 bits.
    """
    buffer = _LevelBuffer(info, levels, frames)
    with closing(images):
        try:
            for time, image in images:
                if levels is not None and image.dtype == np.uint8:
                    raise SourceError(
                        f"{name}: has 8 bits per value already; omit the levels "
                        f"{levels.low:g},{levels.high:g}"
                    )
                yield from buffer.add((time, image))
        except Exception:
            yield from buffer.flush()
            raise
        yield from buffer.flush()


class _LevelBuffer:
    """Buffers images of more than 8 bits until their levels are known."""

    def __init__(self, info: SourceInfo, levels: Levels | None, frames: int) -> None:
        self._info = info
        self._levels = levels
        self._frames = frames
        self._buffered: list[DecodedImage] = []

    def add(self, image: DecodedImage) -> list[TimedImage]:
        """Add an image; returns the converted images that are ready."""
        time, pixels = image
        if self._levels is not None or (pixels.dtype == np.uint8 and not self._buffered):
            return [(time, to_8bit(pixels, self._levels))]
        self._buffered.append(image)
        return self.flush() if len(self._buffered) >= self._frames else []

    def flush(self) -> list[TimedImage]:
        """Convert and return the buffered images."""
        buffered, self._buffered = self._buffered, []
        if not buffered:
            return []
        self._levels = find_levels(image for _, image in buffered)
        if self._levels is not None:
            self._info.levels = self._levels.low, self._levels.high
            option = f"{self._levels.low:.5g},{self._levels.high:.5g}"
            self._info.notes.append(
                f"has more than 8 bits per value: scaled as with --levels {option}"
            )
        return [(time, to_8bit(image, self._levels)) for time, image in buffered]
