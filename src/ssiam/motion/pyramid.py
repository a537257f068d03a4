"""The small gray images of a frame that direct alignment uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform

_LONGER_SIDE: Final = 320  # px of the finest level: accurate, and too coarse for small waves
_LARGE: Final = 4  # times that size, from which frames are resized before conversion to gray


@dataclass(frozen=True, eq=False)
class Pyramid:
    """A gray frame at 320, 80 and 40 pixels along the longer side; (H, W) uint8 each."""

    fine: Image
    coarse: Image
    tiny: Image


class PyramidBuilder:
    """Makes the pyramids of frames of one size.

    Units are those of `ssiam.motion.models`.

    Parameters
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.

    Attributes
    ----------
    fine_wh, coarse_wh : (int, int)
        Width and height of those levels, pixels.
    frame_from_unit, fine_from_unit, coarse_from_unit : (3, 3) float64
        Units to pixels of the frame and of those levels.
    unit_from_frame : (3, 3) float64
        The inverse of `frame_from_unit`.
    tiny_per_unit : (2,) float64
        Pixels of the tiny level per unit along x and y.
    """

    def __init__(self, size_wh: tuple[int, int]) -> None:
        width, height = size_wh
        longer = max(size_wh)
        scale = _LONGER_SIDE / longer
        self.fine_wh = max(round(width * scale), 1), max(round(height * scale), 1)
        self.coarse_wh = (self.fine_wh[0] + 3) // 4, (self.fine_wh[1] + 3) // 4
        self._is_large = longer >= _LARGE * _LONGER_SIDE
        half = longer / 2
        self.frame_from_unit: Transform = np.array(
            [[half, 0, (width - 1) / 2], [0, half, (height - 1) / 2], [0, 0, 1]]
        )
        self._center_twice = np.tile(self.frame_from_unit[:2, 2], 2)
        x_scale, y_scale = np.divide(self.fine_wh, size_wh)
        fine_from_frame = np.array(
            [[x_scale, 0, (x_scale - 1) / 2], [0, y_scale, (y_scale - 1) / 2], [0, 0, 1]]
        )
        self.fine_from_unit = fine_from_frame @ self.frame_from_unit
        self.unit_from_frame: Transform = np.linalg.inv(self.frame_from_unit).astype(np.float64)
        self.coarse_from_unit = np.diag([1 / 4, 1 / 4, 1]) @ self.fine_from_unit
        self.tiny_per_unit = np.diag(self.fine_from_unit)[:2] / 8

    def in_units(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert boxes (N, 4) low xy, high xy from pixels of the frame to units."""
        scaled: NDArray[np.float64] = (boxes - self._center_twice) / self.frame_from_unit[0, 0]
        return scaled

    def from_frame(self, frame: Image) -> Pyramid:
        """The pyramid of a frame (H, W, 3) uint8 BGR."""
        if self._is_large:
            gray = cv2.cvtColor(cv2.resize(frame, self.fine_wh), cv2.COLOR_BGR2GRAY)
        else:
            gray = cv2.resize(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), self.fine_wh)
        return self.from_fine(np.asarray(cv2.GaussianBlur(gray, (3, 3), 0), dtype=np.uint8))

    @staticmethod
    def from_fine(fine: Image) -> Pyramid:
        """The pyramid above a finest level (H, W) uint8."""
        coarse = cv2.pyrDown(cv2.pyrDown(fine))
        tiny = cv2.pyrDown(coarse)
        return Pyramid(fine, *(np.asarray(level, dtype=np.uint8) for level in (coarse, tiny)))
