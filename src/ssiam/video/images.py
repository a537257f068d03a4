"""Image files: every page and every frame in them, in the depth that they have."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray

# Color where there is any, all bits, turned as EXIF says.
_AS_IT_IS = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
# OpenCV makes no color of floating-point TIFF.
_TIFF_AS_IT_IS = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH
_TIFF_SUFFIXES = (".tif", ".tiff")
_TIFF_MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_ANIMATION_FLAG = 0x02  # of the byte after "VP8X" and its size, in WebP
# Pages that are decoded at a time: OpenCV walks over those before them each time.
_CHUNK = 16
# Milliseconds of a frame whose duration is not told, as browsers take it.
_UNTOLD_MS = 100


class UnreadableImage(Exception):
    """An image file that cannot be read, or not to its end."""


def is_stack(head: bytes) -> bool:
    """Whether a file that begins with these 32 bytes is one that `read_pages` has to read."""
    return head[:4] in _TIFF_MAGIC or _is_animated_webp(head)


def page_count(path: Path) -> int:
    """Frames that an image file holds, by its header; at least 1."""
    with path.open("rb") as file:
        head = file.read(32)
        if head[:4] in _TIFF_MAGIC:
            return max(1, _tiff_pages(file, head))
    return max(1, cv2.imcount(str(path))) if _is_animated_webp(head) else 1


def read_pages(path: Path) -> Iterator[tuple[Fraction | None, NDArray[Any]]]:
    """Seconds that each frame of an image file is shown (None: not told), and the frame.

    Frames are (H, W) or (H, W, 3), BGR. The file is read whole.

    Raises
    ------
    UnreadableImage
        At the first frame that cannot be read.
    """
    try:
        count = page_count(path)
        # Not `cv2.imread`, which fails on non-Latin paths under Windows. Nor a map of the file: if
        # another program cuts it meanwhile, the system ends this process (SIGBUS).
        data = np.fromfile(path, dtype=np.uint8)
        head = data[:32].tobytes()
        if head[:4] in _TIFF_MAGIC:
            yield from ((None, page) for page in _tiff(data, count))
        elif _is_animated_webp(head):
            yield from _animation(data, count)
        else:
            yield None, _decoded(data)
    except (OSError, ValueError, cv2.error) as error:
        raise UnreadableImage(path) from error


def _decoded(data: NDArray[np.uint8]) -> NDArray[Any]:
    image: NDArray[Any] | None = cv2.imdecode(data, _AS_IT_IS)
    if image is None:
        raise UnreadableImage
    return image


def _tiff(data: NDArray[np.uint8], count: int) -> Iterator[NDArray[Any]]:
    """Pages; not those smaller than the first, which are previews of it."""
    first: tuple[int, ...] | None = None
    for start in range(0, count, _CHUNK):
        stop = min(start + _CHUNK, count)
        _, pages = cv2.imdecodemulti(data, _TIFF_AS_IT_IS, range=(start, stop))
        for page in pages:
            first = first or page.shape
            if page.shape[0] >= first[0] or page.shape[1] >= first[1]:
                yield np.ascontiguousarray(page[..., :3]) if page.ndim == 3 else page
        if len(pages) < stop - start:
            raise UnreadableImage


def _animation(data: NDArray[np.uint8], count: int) -> Iterator[tuple[Fraction, NDArray[Any]]]:
    for start in range(0, count, _CHUNK):
        wanted = min(_CHUNK, count - start)
        _, animation = cv2.imdecodeanimation(data, start, wanted)
        for frame, milliseconds in zip(animation.frames, animation.durations, strict=False):
            yield (
                Fraction(int(milliseconds) or _UNTOLD_MS, 1000),
                np.ascontiguousarray(frame[..., :3]),
            )
        if len(animation.frames) < wanted:
            raise UnreadableImage


def _is_animated_webp(head: bytes) -> bool:
    is_extended = head[:4] == b"RIFF" and head[8:16] == b"WEBPVP8X"
    return is_extended and len(head) > 20 and bool(head[20] & _ANIMATION_FLAG)


def _tiff_pages(file: BinaryIO, head: bytes) -> int:
    """Directories in a TIFF (or BigTIFF), one that is announced and not there included."""
    order = "<" if head[:2] == b"II" else ">"
    is_big = head[2:4] in (b"+\0", b"\0+")
    count_of, entry, offset_of = ("Q", 20, "Q") if is_big else ("H", 12, "I")
    (place,) = struct.unpack_from(order + offset_of, head, 8 if is_big else 4)
    seen: set[int] = set()
    while place and place not in seen:
        seen.add(place)
        file.seek(place)
        counted = file.read(struct.calcsize(order + count_of))
        if len(counted) < struct.calcsize(order + count_of):
            break
        file.seek(struct.unpack(order + count_of, counted)[0] * entry, 1)
        following = file.read(struct.calcsize(order + offset_of))
        if len(following) < struct.calcsize(order + offset_of):
            break
        (place,) = struct.unpack(order + offset_of, following)
    return len(seen)
