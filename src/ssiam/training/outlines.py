"""Outlines of objects as annotations tell them, polygons or runs of pixels, and their masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.training.sources import Mask

# Bits of a fraction of a pixel that OpenCV draws polygons with.
_SHIFT = 4
# Pixels that a mask may have: more is no picture.
_MAX_PIXELS = 1 << 28
# Compressed runs: six bits a character from "0" on, of which the sixth says that more follow.
_ZERO, _BITS, _MORE, _SIGN = 48, 5, 32, 16


class Outline(Protocol):
    """What an annotation tells of an object's shape."""

    def mask(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) bool in a picture of (width, height) pixels."""


@dataclass(frozen=True, eq=False)
class Polygons:
    """Rings of corners, filled together.

    Attributes
    ----------
    rings : tuple of (N, 2) float32
        Corners x, y; pixels whose first one reaches from 0 to 1, or shares of the picture's
        width and height.
    as_shares : bool
    """

    rings: tuple[NDArray[np.float32], ...]
    as_shares: bool = False

    def mask(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) bool in a picture of (width, height) pixels."""
        canvas = np.zeros(size_wh[::-1], dtype=np.uint8)
        unit = size_wh if self.as_shares else (1, 1)
        limit = 2.0 * max(size_wh)
        rings = [np.clip(ring * unit - 0.5, -limit, limit) for ring in self.rings]
        fixed = [np.rint(ring * (1 << _SHIFT)).astype(np.int32) for ring in rings]
        cv2.fillPoly(canvas, fixed, (1,), lineType=cv2.LINE_8, shift=_SHIFT)
        return canvas.astype(np.bool_)


@dataclass(frozen=True, eq=False)
class Runs:
    """Lengths of runs of pixels, column by column, in turn outside and inside of the object.

    Attributes
    ----------
    counts : (N,) int64
    size_wh : (int, int)
        Width and height of the picture that they were made for.
    """

    counts: NDArray[np.int64]
    size_wh: tuple[int, int]

    def __post_init__(self) -> None:
        width, height = self.size_wh
        if not 0 < width * height <= _MAX_PIXELS or min(self.size_wh) <= 0:
            raise ArgumentError(f"runs for a picture of {width}x{height} pixels")
        if (self.counts < 0).any() or self.counts.sum() != width * height:
            raise ArgumentError(
                f"runs of {self.counts.sum()} pixels for a picture of {width}x{height}"
            )

    def mask(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) bool; `ArgumentError` if the picture has another size."""
        if size_wh != self.size_wh:
            raise ArgumentError(f"a mask of {self.size_wh} pixels for a picture of {size_wh}")
        inside = np.arange(len(self.counts)) % 2 == 1
        return np.repeat(inside, self.counts).reshape(size_wh).T


def unpacked_runs(packed: str) -> NDArray[np.int64]:
    """Lengths of runs (N,) of COCO's compressed text; `ArgumentError` if it breaks off."""
    counts: list[int] = []
    value = shift = 0
    for character in packed:
        code = ord(character) - _ZERO
        if not 0 <= code < 2 * _MORE or shift > 60:
            raise ArgumentError(f"compressed runs hold {character!r}")
        value |= (code & (_MORE - 1)) << shift
        shift += _BITS
        if not code & _MORE:
            value -= (1 << shift) if code & _SIGN else 0
            # From the third run of a kind on, the difference to the last one of its kind.
            counts.append(value + (counts[-2] if len(counts) > 2 else 0))
            value = shift = 0
    if shift:
        raise ArgumentError("compressed runs break off")
    return np.array(counts, dtype=np.int64)


def box_of_mask(mask: Mask) -> XYWH | None:
    """Box of the columns and rows that a mask (H, W) covers; None of an empty one."""
    x, y, w, h = cv2.boundingRect(mask.astype(np.uint8))
    return (float(x), float(y), float(w), float(h)) if w else None


def box_of_shares(shares: Sequence[float], size_wh: tuple[int, int]) -> XYWH:
    """Box from its centre, width and height as shares of the picture's size."""
    cx, cy, w, h = shares
    width, height = size_wh
    return (cx - w / 2) * width, (cy - h / 2) * height, w * width, h * height
