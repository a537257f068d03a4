"""`Orientation`: the display matrix of a frame, which turns and mirrors it upright."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from av.video.frame import VideoFrame
from numpy.typing import NDArray

# FFmpeg's display matrix: nine 32-bit integers, of which the first two of the first two rows
# hold a, b, c, d of x' = a x + c y, y' = b x + d y.
_MATRIX = struct.Struct("=9i")


@dataclass(frozen=True)
class Orientation:
    """One of the eight ways to lay an image on a screen: transposed first, then mirrored."""

    is_transposed: bool = False
    is_mirrored_x: bool = False
    is_mirrored_y: bool = False

    def applied(self, image: NDArray[Any]) -> NDArray[Any]:
        """The (H, W) or (H, W, C) image as it is to be seen; contiguous."""
        if self.is_transposed:
            image = image.swapaxes(0, 1)
        if self.is_mirrored_x:
            image = image[:, ::-1]
        if self.is_mirrored_y:
            image = image[::-1]
        return np.ascontiguousarray(image)


class Orientations:
    """The orientation of each frame of a stream, read anew where the frame's turn changes.

    PyAV's side data and their frame hold each other: read of every frame, they would keep
    hundreds of frames in memory until Python looks for such circles.
    """

    def __init__(self) -> None:
        self._turn: int | None = None
        self._orientation = Orientation()

    def of(self, frame: VideoFrame) -> Orientation:
        """How the frame is to be shown; of angles between, the nearest quarter turn."""
        if frame.rotation != self._turn:
            self._turn, self._orientation = frame.rotation, _read(frame)
        return self._orientation


def _read(frame: VideoFrame) -> Orientation:
    matrix: Any = frame.side_data.get("DISPLAYMATRIX")
    data = b"" if matrix is None else bytes(matrix)
    if len(data) < _MATRIX.size:
        return Orientation()
    a, b, _, c, d, *_ = _MATRIX.unpack_from(data)
    if abs(a) + abs(d) >= abs(b) + abs(c):
        return Orientation(False, a < 0, d < 0)
    return Orientation(True, c < 0, b < 0)
