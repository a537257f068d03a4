"""What is kept of a frame: three small grey pictures of it, and how their pixels lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform

_LONGER_SIDE: Final = 320  # px of the finest picture: exact enough, and blind to small waves
_HUGE: Final = 4  # times that size, from which on colour is reduced after the size


@dataclass(frozen=True, eq=False)
class Picture:
    """A frame in grey, 320, 80 and 40 pixels long; (H, W) uint8 each."""

    fine: Image
    coarse: Image
    tiny: Image


class Scales:
    """Makes the pictures of frames of one size.

    Attributes
    ----------
    fine_wh, coarse_wh : (int, int)
        Width and height of those pictures, pixels.
    frame_from_unit, fine_from_unit, coarse_from_unit : (3, 3) float64
        Pixels of the frame and of those pictures, from units (see `models`).
    unit_from_frame : (3, 3) float64
    tiny_per_unit : (2,) float64
        Pixels of the tiny picture along x and y.
    """

    def __init__(self, size_wh: tuple[int, int]) -> None:
        width, height = size_wh
        longer = max(size_wh)
        scale = _LONGER_SIDE / longer
        self.fine_wh = max(round(width * scale), 1), max(round(height * scale), 1)
        self.coarse_wh = (self.fine_wh[0] + 3) // 4, (self.fine_wh[1] + 3) // 4
        self._huge = longer >= _HUGE * _LONGER_SIDE
        half = longer / 2
        self.frame_from_unit: Transform = np.array(
            [[half, 0, (width - 1) / 2], [0, half, (height - 1) / 2], [0, 0, 1]]
        )
        self._middles = np.tile(self.frame_from_unit[:2, 2], 2)
        x_scale, y_scale = np.divide(self.fine_wh, size_wh)
        fine_from_frame = np.array(
            [[x_scale, 0, (x_scale - 1) / 2], [0, y_scale, (y_scale - 1) / 2], [0, 0, 1]]
        )
        self.fine_from_unit = fine_from_frame @ self.frame_from_unit
        self.unit_from_frame: Transform = np.linalg.inv(self.frame_from_unit).astype(np.float64)
        self.coarse_from_unit = np.diag([1 / 4, 1 / 4, 1]) @ self.fine_from_unit
        self.tiny_per_unit = np.diag(self.fine_from_unit)[:2] / 8

    def in_units(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Boxes (N, 4) low xy, high xy, from the frame's pixels to units."""
        scaled: NDArray[np.float64] = (boxes - self._middles) / self.frame_from_unit[0, 0]
        return scaled

    def picture(self, frame: Image) -> Picture:
        """The three pictures of a frame (H, W, 3) uint8 BGR."""
        if self._huge:
            gray = cv2.cvtColor(cv2.resize(frame, self.fine_wh), cv2.COLOR_BGR2GRAY)
        else:
            gray = cv2.resize(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), self.fine_wh)
        return self.pyramid(np.asarray(cv2.GaussianBlur(gray, (3, 3), 0), dtype=np.uint8))

    @staticmethod
    def pyramid(fine: Image) -> Picture:
        """The three pictures of the finest one."""
        coarse = cv2.pyrDown(cv2.pyrDown(fine))
        tiny = cv2.pyrDown(coarse)
        return Picture(fine, *(np.asarray(p, dtype=np.uint8) for p in (coarse, tiny)))
