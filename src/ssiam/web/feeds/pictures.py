"""`decode_picture`: JPEG from a stranger, into a picture or an error."""

from __future__ import annotations

import struct

import cv2
import numpy as np

from ssiam.errors import ArgumentError
from ssiam.geometry import Image

_START, _END = b"\xff\xd8", b"\xff\xd9"
_START_OF_SCAN = 0xDA
# Start of frame, all kinds; between them lie three markers of other kinds.
_START_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
# What may come before it: tables, intervals, remarks and what programs add. All of them tell
# their length; a marker without one would let a decoder read another size than this does.
_SKIPPED = frozenset((0xC4, 0xCC, 0xDB, 0xDD, 0xFE, *range(0xE0, 0xF0)))
# A progressive picture of ten scans is usual. Every scan of a few bytes costs the decoder a walk
# over the whole picture.
_MOST_SCANS = 20


def decode_picture(data: bytes, limit_pixels: int = 4096 * 4096) -> Image:
    """The picture in `data`, a whole JPEG file: (H, W, 3) uint8 BGR, upright.

    Its size is read from the header before anything is decoded.

    Raises
    ------
    ArgumentError
        It is no JPEG, is damaged or cut, or has more than `limit_pixels` pixels.
    """
    if not data.startswith(_START):
        raise ArgumentError(f"a picture of {len(data)} bytes is not a JPEG; send JPEG only")
    width, height = _size_wh(data)
    if not 0 < width * height <= limit_pixels:
        raise ArgumentError(
            f"a JPEG of {width}x{height} pixels: at least 1 and at most {limit_pixels} can be used"
        )
    if not data.endswith(_END):
        raise ArgumentError(f"a JPEG of {len(data)} bytes is cut: it does not end as JPEGs do")
    if data.count(bytes((0xFF, _START_OF_SCAN))) > _MOST_SCANS:
        raise ArgumentError(f"a JPEG of more than {_MOST_SCANS} scans; send a plain one")
    return _decoded(data)


def _size_wh(data: bytes) -> tuple[int, int]:
    """Width and height by the header, as the decoder will read it: no byte between its parts."""
    place = len(_START)
    while place + 9 <= len(data) and data[place] == 0xFF:
        marker, length = struct.unpack_from(">xBH", data, place)
        if marker in _START_OF_FRAME:
            height, width = struct.unpack_from(">HH", data, place + 5)
            return width, height
        if marker not in _SKIPPED or length < 2:
            break
        place += 2 + length
    raise ArgumentError(f"a JPEG of {len(data)} bytes has no readable header; send it again")


def _decoded(data: bytes) -> Image:
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        image = None
    if image is None:
        raise ArgumentError(f"a JPEG of {len(data)} bytes is damaged; send it again")
    return np.asarray(image, dtype=np.uint8)
