"""Pictures of training data, the last few kept, and pictures whose pixels are labels."""

from __future__ import annotations

import struct
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import read_image
from ssiam.errors import SourceError
from ssiam.geometry import Image

Labels = NDArray[np.int32]

# Pictures kept: a pair's two, and one more of each for its objects.
_KEPT = 4
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


@lru_cache(maxsize=_KEPT)
def picture(path: Path) -> Image:
    """An image file as (H, W, 3) uint8 BGR, not to be written to; `SourceError` if it is none."""
    image = read_image(path)
    image.flags.writeable = False
    return image


def size_of(image: NDArray[np.generic]) -> tuple[int, int]:
    """Width and height of a picture (H, W, ...), pixels."""
    return image.shape[1], image.shape[0]


@lru_cache(maxsize=_KEPT)
def label_picture(path: Path) -> Labels:
    """Labels (H, W) of a picture that tells an object by its grey or colour; 0 is none of them.

    A label is the index in the palette of a PNG that has one, else the grey, or the colour as
    0xRRGGBB.

    Raises
    ------
    SourceError
        The file is missing or no image.
    """
    try:
        encoded = np.fromfile(path, dtype=np.uint8)
        image = cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED) if encoded.size else None
    except (OSError, cv2.error):
        image = None
    if image is None:
        raise SourceError(f"{path}: is not a mask that can be read; get it again")
    labels = _numbers(np.asarray(image))
    palette = _palette(encoded.tobytes())
    if palette is not None and image.ndim == 3:
        labels = _indices(labels, palette)
    labels.flags.writeable = False
    return labels


def _numbers(image: NDArray[np.generic]) -> Labels:
    if image.ndim == 2:
        return image.astype(np.int32)
    blue, green, red = (image[..., i].astype(np.int32) for i in range(3))
    return (red << 16) | (green << 8) | blue


def _palette(data: bytes) -> Labels | None:
    """Colours (N,) of a PNG's palette; None if it has none."""
    if not data.startswith(_SIGNATURE):
        return None
    at = len(_SIGNATURE)
    while at + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        if kind == b"PLTE":
            rgb = np.frombuffer(data[at + 8 : at + 8 + length // 3 * 3], dtype=np.uint8)
            return _numbers(rgb.reshape(-1, 1, 3)[..., ::-1])[:, 0]
        if kind == b"IDAT":
            return None
        at += length + 12
    return None


def _indices(colours: Labels, palette: Labels) -> Labels:
    """Indices (H, W) of colours in a palette: of the first, where it holds one twice."""
    known, first = np.unique(palette, return_index=True)
    place = np.clip(np.searchsorted(known, colours), 0, len(known) - 1)
    return np.asarray(np.where(known[place] == colours, first[place], 0), dtype=np.int32)
