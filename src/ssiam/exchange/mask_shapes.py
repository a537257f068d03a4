"""Masks in the forms of annotation tools: polygons, CVAT's run lengths, Label Studio's brush."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeAlias

import cv2
import numpy as np

from ssiam.exchange.annotations import Annotation
from ssiam.geometry import Mask, mask_bounds
from ssiam.video.mask_codec import decode_mask, run_lengths

Polygon: TypeAlias = list[tuple[float, float]]

_TOLERANCE: Final = 0.7  # px by which a polygon may differ from the outline of the mask
_LEAST_POINTS: Final = 3
# Label Studio's brush: an image of four channels as runs of bytes.
_CHANNELS: Final = 4
_LENGTH_BITS: Final = (4, 8, 12, 16)  # of the lengths of runs, each with a code of two bits
_BYTE_BITS: Final = 8
_OPAQUE: Final = 255


def mask_of(annotation: Annotation, size_wh: tuple[int, int]) -> Mask | None:
    """The mask (H, W) of an annotation; None without one, or if it is empty."""
    if annotation.mask is None:
        return None
    mask = decode_mask(annotation.mask, size_wh)
    return mask if mask.any() else None


def polygon(mask: Mask) -> Polygon | None:
    """Outline of the largest part of a mask, in pixels whose edges are whole numbers.

    None if it has less than three corners.
    """
    # Twice as large, contours through pixel centers are close to the pixels' edges.
    doubled = cv2.resize(mask.view(np.uint8), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    contours = cv2.findContours(doubled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[-2]
    if not contours:
        return None
    largest = max(contours, key=cv2.contourArea)
    points = np.asarray(cv2.approxPolyDP(largest, 2 * _TOLERANCE, True)).reshape(-1, 2)
    if len(points) < _LEAST_POINTS:
        return None
    return [(float(x), float(y)) for x, y in ((points + 0.5) / 2).tolist()]


@dataclass(frozen=True)
class CvatMask:
    """A mask as in a ``<mask>`` of CVAT.

    Attributes
    ----------
    left, top, width, height : int
        Bounds of the mask, pixels.
    runs : list of int
        Lengths of runs along the rows of the bounds, background and target in turn.
    """

    left: int
    top: int
    width: int
    height: int
    runs: list[int]


def cvat_mask(mask: Mask) -> CvatMask:
    """The form of CVAT; the mask is not empty."""
    rows, columns = mask_bounds(mask)
    part = mask[rows, columns]
    height, width = part.shape
    return CvatMask(columns.start, rows.start, width, height, run_lengths(part.ravel()))


def brush_rle(mask: Mask) -> list[int]:
    """The `rle` of Label Studio's brush: bytes of packed runs of an RGBA image.

    After a head (number of bytes in 32 bits, their width, the widths of the lengths of runs) come
    blocks: a bit for "run", two bits for the width of the length, the length less 1, and the byte.
    """
    head = [(mask.size * _CHANNELS, 32), (_BYTE_BITS - 1, 5), *((n - 1, 4) for n in _LENGTH_BITS)]
    fields = [f"{value:0{bits}b}" for value, bits in head]
    longest = 1 << _LENGTH_BITS[-1]
    for index, pixels in enumerate(run_lengths(mask.ravel())):
        value = f"{_OPAQUE * (index % 2):0{_BYTE_BITS}b}"
        rest = pixels * _CHANNELS
        while rest:
            length = min(rest, longest)
            rest -= length
            code = next(i for i, bits in enumerate(_LENGTH_BITS) if length <= 1 << bits)
            fields.append(f"1{code:02b}{length - 1:0{_LENGTH_BITS[code]}b}{value}")
    bits = "".join(fields)
    bits += "0" * (-len(bits) % _BYTE_BITS)
    return list(int(bits, 2).to_bytes(len(bits) // _BYTE_BITS, "big"))
