"""Masks from annotations: polygons, run-length encodings and mask images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError, SourceError
from ssiam.geometry import XYWH
from ssiam.training.data.images import image_size, read_labels

__all__ = [
    "Mask",
    "MaskImage",
    "Outline",
    "Polygons",
    "RunLengths",
    "box_of_fractions",
    "box_of_mask",
    "decode_coco_counts",
]

Mask: TypeAlias = NDArray[np.bool_]

_SUBPIXEL_BITS: Final = 4  # of the polygon corners that OpenCV draws
_MAX_PIXELS: Final = 1 << 28  # larger masks are rejected
_FOREGROUND: Final = 128  # of 255; gray masks may have soft edges
# COCO's compressed counts: characters from "0" on carry 5 bits and a continuation bit.
_ZERO, _BITS, _MORE, _SIGN = 48, 5, 32, 16


class Outline(Protocol):
    """The shape of an object in an annotation."""

    def mask(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) bool in an image of (width, height) px."""


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons that are filled together.

    Attributes
    ----------
    rings : tuple of (N, 2) float32
        Corners x, y: px, where the first pixel extends from 0 to 1, or fractions of the image's
        width and height.
    as_fractions : bool
    """

    rings: tuple[NDArray[np.float32], ...]
    as_fractions: bool = False

    def mask(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) bool in an image of (width, height) px."""
        canvas = np.zeros(size_wh[::-1], dtype=np.uint8)
        unit = size_wh if self.as_fractions else (1, 1)
        limit = 2.0 * max(size_wh)
        rings = [np.clip(ring * unit - 0.5, -limit, limit) for ring in self.rings]
        fixed = [np.rint(ring * (1 << _SUBPIXEL_BITS)).astype(np.int32) for ring in rings]
        cv2.fillPoly(canvas, fixed, (1,), lineType=cv2.LINE_8, shift=_SUBPIXEL_BITS)
        return canvas.astype(np.bool_)


@dataclass(frozen=True, eq=False)
class RunLengths:
    """Column-major run lengths, alternately of background and object, as in COCO.

    Attributes
    ----------
    counts : (N,) int64
    size_wh : (int, int)
        Width and height of the annotated image, px.

    Raises
    ------
    ArgumentError
        The size is implausible, or the runs do not add up to it.
    """

    counts: NDArray[np.int64]
    size_wh: tuple[int, int]

    def __post_init__(self) -> None:
        width, height = self.size_wh
        if not 0 < width * height <= _MAX_PIXELS or min(self.size_wh) <= 0:
            raise ArgumentError(
                f"run lengths for an image of {width}x{height} pixels, an implausible size"
            )
        if (self.counts < 0).any() or self.counts.sum() != width * height:
            raise ArgumentError(
                f"run lengths of {self.counts.sum()} pixels for an image of {width}x{height}"
            )

    def mask(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) bool; `ArgumentError` if the image has another size."""
        if size_wh != self.size_wh:
            raise ArgumentError(f"a mask of {self.size_wh} pixels for an image of {size_wh}")
        inside = np.arange(len(self.counts)) % 2 == 1
        return np.repeat(inside, self.counts).reshape(size_wh).T


@dataclass(frozen=True)
class MaskImage:
    """A mask in an image file: gray levels of at least 128, or any color but black."""

    path: Path

    def mask(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) bool.

        Raises
        ------
        SourceError
            The file is not an image, or has another size than `size_wh`.
        """
        labels = read_labels(self.path)
        if image_size(labels) != size_wh:
            width, height = image_size(labels)
            raise SourceError(
                f"{self.path}: has {width}x{height} pixels, its image {size_wh[0]}x{size_wh[1]}"
            )
        return labels >= _FOREGROUND


def decode_coco_counts(text: str) -> NDArray[np.int64]:
    """Run lengths (N,) of COCO's compressed text.

    Raises
    ------
    ArgumentError
        The text is truncated or has invalid characters.
    """
    counts: list[int] = []
    value = shift = 0
    for character in text:
        code = ord(character) - _ZERO
        if not 0 <= code < 2 * _MORE or shift > 60:
            raise ArgumentError(f"invalid character {character!r} in compressed run lengths")
        value |= (code & (_MORE - 1)) << shift
        shift += _BITS
        if not code & _MORE:
            value -= (1 << shift) if code & _SIGN else 0
            # From the fourth run on, the text has the difference from the run two before.
            counts.append(value + (counts[-2] if len(counts) > 2 else 0))
            value = shift = 0
    if shift:
        raise ArgumentError("compressed run lengths are truncated")
    return np.array(counts, dtype=np.int64)


def box_of_mask(mask: Mask) -> XYWH | None:
    """The bounding box of a mask (H, W), px; None if the mask is empty."""
    x, y, w, h = cv2.boundingRect(mask.astype(np.uint8))
    return (float(x), float(y), float(w), float(h)) if w else None


def box_of_fractions(cxcywh: Sequence[float], size_wh: tuple[int, int]) -> XYWH:
    """The box x, y, w, h in px from its center and size in fractions of the image's size."""
    cx, cy, w, h = cxcywh
    width, height = size_wh
    return (cx - w / 2) * width, (cy - h / 2) * height, w * width, h * height
