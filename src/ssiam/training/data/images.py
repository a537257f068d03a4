"""Images of training data with a small cache, and label images."""

from __future__ import annotations

import struct
from functools import lru_cache
from pathlib import Path
from typing import Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import read_image
from ssiam.errors import SourceError
from ssiam.geometry import Image
from ssiam.video.image_sizes import check_file, check_pixels, declared_sizes

__all__ = ["image_size", "read_cached", "read_labels", "read_unchanged"]

Labels: TypeAlias = NDArray[np.int32]

# Images: the two of a pair, and one more for the distractors of each.
_CACHED: Final = 4
_PNG_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"


@lru_cache(maxsize=_CACHED)
def read_cached(path: Path) -> Image:
    """An image file as read-only (H, W, 3) uint8 BGR.

    Raises
    ------
    SourceError
        The file is missing or not an image.
    """
    image = read_image(path)
    image.flags.writeable = False
    return image


def image_size(image: NDArray[np.generic]) -> tuple[int, int]:
    """Width and height of an image (H, W, ...), px."""
    return image.shape[1], image.shape[0]


@lru_cache(maxsize=_CACHED)
def read_labels(path: Path) -> Labels:
    """Read-only labels (H, W) of an image that encodes objects by gray level or color.

    A label is the palette index in a PNG with a palette, else the gray level, or the color as
    0xRRGGBB. 0 is the background.

    Raises
    ------
    SourceError
        The file is missing or not an image.
    """
    encoded, image = read_unchanged(path)
    if image is None:
        raise SourceError(f"{path}: is not a readable mask; get it again")
    labels = _color_codes(image)
    palette = _palette(encoded)
    if palette is not None and image.ndim == 3:
        labels = _palette_indices(labels, palette)
    labels.flags.writeable = False
    return labels


def read_unchanged(path: Path) -> tuple[bytes, NDArray[np.generic] | None]:
    """The bytes of an image file, and the image with all its channels; None if it is damaged."""
    try:
        check_file(path, is_stack=False)
        encoded = np.fromfile(path, dtype=np.uint8)
        sizes = declared_sizes(encoded.tobytes())
        for width, height in sizes:
            check_pixels(str(path), width, height)
        image = cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED) if sizes else None
    except (OSError, MemoryError, cv2.error):
        return b"", None
    return encoded.tobytes(), None if image is None else np.asarray(image)


def _color_codes(image: NDArray[np.generic]) -> Labels:
    if image.ndim == 2:
        return image.astype(np.int32)
    blue, green, red = (image[..., i].astype(np.int32) for i in range(3))
    return (red << 16) | (green << 8) | blue


def _palette(data: bytes) -> Labels | None:
    """Colors (N,) of a PNG's palette; None without one."""
    if not data.startswith(_PNG_SIGNATURE):
        return None
    offset = len(_PNG_SIGNATURE)
    while offset + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, offset)
        if kind == b"PLTE":
            start = offset + 8
            rgb = np.frombuffer(data[start : start + length // 3 * 3], dtype=np.uint8)
            return _color_codes(rgb.reshape(-1, 1, 3)[..., ::-1])[:, 0]
        if kind == b"IDAT":
            return None
        offset += length + 12
    return None


def _palette_indices(colors: Labels, palette: Labels) -> Labels:
    """Palette indices (H, W) of colors; the first one if a color occurs twice."""
    known, first = np.unique(palette, return_index=True)
    index = np.clip(np.searchsorted(known, colors), 0, len(known) - 1)
    return np.asarray(np.where(known[index] == colors, first[index], 0), dtype=np.int32)
