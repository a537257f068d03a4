"""`PushedFeed`: frames that a browser sends as JPEG images, and their decoder."""

from __future__ import annotations

import struct
import time
from collections import deque
from typing import Final

import cv2
import numpy as np

from ssiam.errors import ArgumentError
from ssiam.geometry import Image, check_frame
from ssiam.video import Frame
from ssiam.web.feeds.base import Feed

_RATE_FRAMES: Final = 30  # frames over which the rate is averaged

_SOI, _EOI = b"\xff\xd8", b"\xff\xd9"  # markers of a JPEG's start and end
_SOS: Final = 0xDA  # start of scan
# Start of frame (SOF), all kinds; three markers in this range have another meaning.
_SOF: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
# Segments allowed before the frame: tables, restart intervals, comments and application data. They
# all have a length. After a marker without one, this parser and the decoder could find different
# frame headers, and therefore different sizes.
_SKIPPED: Final = frozenset((0xC4, 0xCC, 0xDB, 0xDD, 0xFE, *range(0xE0, 0xF0)))
# Progressive images usually have about ten scans. For each scan, even one of a few bytes, the
# decoder processes the whole image.
_MAX_SCANS: Final = 20


class PushedFeed(Feed):
    """Frames of any size that a browser pushes.

    The size and the rate are None until frames have arrived. The time of a frame is its arrival.
    """

    def __init__(self, name: str = "browser") -> None:
        super().__init__(name)
        self._count = 0
        self._first_time = 0.0
        self._recent_times: deque[float] = deque(maxlen=_RATE_FRAMES)

    def push(self, image: Image) -> None:
        """Add a frame (H, W, 3) uint8 BGR; `ArgumentError` if it is not one."""
        size_wh = check_frame(image)
        with self._changed:
            if self._closed:
                return
            now = time.monotonic()
            self._first_time = now if not self._count else self._first_time
            self._recent_times.append(now)
            self.size_wh, self.fps = size_wh, self._rate()
            self._put(Frame(self._count, now - self._first_time, image))
            self._count += 1

    def _rate(self) -> float | None:
        """Recent frames per second."""
        seconds = self._recent_times[-1] - self._recent_times[0]
        return (len(self._recent_times) - 1) / seconds if seconds > 0 else None


def decode_jpeg(data: bytes, limit_pixels: int = 4096 * 4096) -> Image:
    """Decode a JPEG file of untrusted origin.

    The size is checked in the header before anything is decoded.

    Parameters
    ----------
    data : bytes
        A complete JPEG file.
    limit_pixels : int
        Maximum of width x height.

    Returns
    -------
    (H, W, 3) uint8
        BGR, rotated upright by its EXIF orientation.

    Raises
    ------
    ArgumentError
        The data is not a JPEG, is damaged or truncated, or has too many pixels.
    """
    if not data.startswith(_SOI):
        raise ArgumentError(f"an image of {len(data)} bytes is not a JPEG; send JPEG only")
    width, height = _size_wh(data)
    if not 0 < width * height <= limit_pixels:
        raise ArgumentError(
            f"a JPEG of {width}x{height} pixels: send at least 1 and at most {limit_pixels} pixels"
        )
    if not data.endswith(_EOI):
        raise ArgumentError(f"a JPEG of {len(data)} bytes is truncated; send it again")
    if data.count(bytes((0xFF, _SOS))) > _MAX_SCANS:
        raise ArgumentError(f"a JPEG of more than {_MAX_SCANS} scans; send a baseline JPEG")
    return _decoded(data)


def _size_wh(data: bytes) -> tuple[int, int]:
    """Width and height in the header; the segments before it must be contiguous."""
    offset = len(_SOI)
    while offset + 9 <= len(data) and data[offset] == 0xFF:
        marker, length = struct.unpack_from(">xBH", data, offset)
        if marker in _SOF:
            height, width = struct.unpack_from(">HH", data, offset + 5)
            return width, height
        if marker not in _SKIPPED or length < 2:
            break
        offset += 2 + length
    raise ArgumentError(f"a JPEG of {len(data)} bytes has no readable header; send it again")


def _decoded(data: bytes) -> Image:
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        image = None
    if image is None:
        raise ArgumentError(f"a JPEG of {len(data)} bytes is damaged; send it again")
    return np.asarray(image, dtype=np.uint8)
