"""The sizes that image files declare, checked before anything is decoded."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from stat import S_ISREG
from typing import Final

from ssiam.errors import ArgumentError, SourceError

__all__ = ["check_file", "check_pixels", "declared_sizes", "max_pixels"]

MAX_PIXELS_VARIABLE: Final = "SSIAM_MAX_PIXELS"
# 16,000 x 8,000 pixels, more than any camera's; a frame of 8 bits has 384 MB.
_MAX_PIXELS: Final = 128_000_000
_PIXEL_BYTES: Final = 8  # four channels of 16 bits
_STACK_PAGES: Final = 8  # pages of the most pixels that a file may have
_TIFF_MAGIC: Final = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_TIFF_SIZES: Final = (256, 257)  # tags ImageWidth and ImageLength
_TIFF_FORMATS: Final = {1: "B", 3: "H", 4: "I", 16: "Q"}  # of unsigned integers
_MAX_ENTRIES: Final = 4096  # of a TIFF's page; usual ones have less than 50
_MAX_PAGES: Final = 1_000_000
_MAX_SKIPPED: Final = 4096  # bytes between the segments of a JPEG
# Markers of JPEG: frame headers (not DHT, JPG and DAC among them), and those without a length
_JPEG_SIZES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_BARE: Final = frozenset((0x01, *range(0xD0, 0xD9)))


def max_pixels() -> int:
    """The most pixels of one image or frame: the variable SSIAM_MAX_PIXELS, or 128 million.

    Raises
    ------
    ArgumentError
        The variable is not a number of pixels.
    """
    word = os.environ.get(MAX_PIXELS_VARIABLE, "")
    if not word:
        return _MAX_PIXELS
    try:
        value = int(word)
    except ValueError:
        value = 0
    if value < 1:
        raise ArgumentError(f"{MAX_PIXELS_VARIABLE}={word[:40]!r}: give a number of pixels")
    return value


def check_pixels(name: str, width: int, height: int) -> None:
    """Raise `SourceError` if an image or frame of this size has too many pixels."""
    limit = max_pixels()
    if width * height > limit:
        raise SourceError(
            f"{name}: has {width}x{height} pixels, more than {limit}; if you trust it, set "
            f"{MAX_PIXELS_VARIABLE}={width * height}"
        )


def check_file(path: Path, *, is_stack: bool) -> None:
    """Check that a file can be read whole: not a pipe or a device, and not too large.

    Parameters
    ----------
    path : Path
    is_stack : bool
        Whether it may have several pages or frames.

    Raises
    ------
    OSError
        It is not a file.
    SourceError
        It has more bytes than images of `max_pixels` pixels need.
    """
    status = path.stat()
    if not S_ISREG(status.st_mode):
        raise OSError(f"{path} is not a file")
    pixels = math.ceil(status.st_size / (_PIXEL_BYTES * (_STACK_PAGES if is_stack else 1)))
    if pixels > max_pixels():
        raise SourceError(
            f"{path}: has {status.st_size} bytes, more than an image needs; if you trust it, set "
            f"{MAX_PIXELS_VARIABLE}={pixels}"
        )


def declared_sizes(data: bytes | memoryview) -> list[tuple[int, int]]:
    """Width and height of each image of a JPEG, PNG, BMP, TIFF or WebP file, by its headers.

    Empty if the file is of another kind, or damaged before the size.
    """
    head = bytes(data[:32])
    try:
        if head[:4] in _TIFF_MAGIC:
            return list(_tiff(data))
        if head[:3] == b"\xff\xd8\xff":
            return [_jpeg(data)]
        if head[:8] == b"\x89PNG\r\n\x1a\n":
            return [_png(data)]
        if head[:2] == b"BM":
            return [_bmp(head)]
        if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
            return [_webp(head)]
    except (struct.error, IndexError, OverflowError):
        return []
    return []


def _png(data: bytes | memoryview) -> tuple[int, int]:
    """The size; `IndexError` if a chunk is longer than the file: OpenCV would allocate it."""
    offset = 8
    while offset + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, offset)
        if length > len(data) or not kind.isalpha():
            raise IndexError
        if kind == b"IEND":
            break
        offset += 12 + length
    width, height = struct.unpack_from(">II", data, 16)
    return width, height


def _jpeg(data: bytes | memoryview) -> tuple[int, int]:
    offset, skipped = 2, 0
    while skipped <= _MAX_SKIPPED:
        if data[offset] != 0xFF:
            offset += 1  # decoders skip bytes between segments
            skipped += 1
            continue
        marker = data[offset + 1]
        if marker == 0xFF or marker in _JPEG_BARE or marker == 0:
            offset += 1 if marker == 0xFF else 2
            skipped += 1
            continue
        if marker in _JPEG_SIZES:
            height, width = struct.unpack_from(">HH", data, offset + 5)
            return width, height
        offset += 2 + max(struct.unpack_from(">H", data, offset + 2)[0], 2)
    raise IndexError


def _bmp(head: bytes) -> tuple[int, int]:
    if struct.unpack_from("<I", head, 14)[0] == 12:  # the header of OS/2
        width, height = struct.unpack_from("<HH", head, 18)
        return width, height
    width, height = struct.unpack_from("<ii", head, 18)
    return abs(width), abs(height)


def _webp(head: bytes) -> tuple[int, int]:
    kind = head[12:16]
    if kind == b"VP8X":
        width, height = (int.from_bytes(head[i : i + 3], "little") for i in (24, 27))
        return width + 1, height + 1
    if kind == b"VP8L":
        bits = int.from_bytes(head[21:25], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    width, height = struct.unpack_from("<HH", head, 26)
    return width & 0x3FFF, height & 0x3FFF


def _tiff(data: bytes | memoryview) -> Iterator[tuple[int, int]]:
    order = "<" if bytes(data[:2]) == b"II" else ">"
    is_big = bytes(data[2:4]) in (b"+\0", b"\0+")
    count_format, entry_size, offset_format = ("Q", 20, "Q") if is_big else ("H", 12, "I")
    (offset,) = struct.unpack_from(order + offset_format, data, 8 if is_big else 4)
    visited: set[int] = set()
    while offset and offset not in visited and len(visited) < _MAX_PAGES:
        visited.add(offset)
        if offset >= len(data):
            return
        (count,) = struct.unpack_from(order + count_format, data, offset)
        start = offset + struct.calcsize(count_format)
        sizes = {}
        for number in range(min(count, _MAX_ENTRIES)):
            entry = start + number * entry_size
            tag, kind = struct.unpack_from(f"{order}HH", data, entry)
            if tag in _TIFF_SIZES and kind in _TIFF_FORMATS:
                value = entry + (12 if is_big else 8)
                (sizes[tag],) = struct.unpack_from(order + _TIFF_FORMATS[kind], data, value)
        yield sizes.get(256, 0), sizes.get(257, 0)
        end = start + count * entry_size
        if end + struct.calcsize(offset_format) > len(data):
            return
        (offset,) = struct.unpack_from(order + offset_format, data, end)
