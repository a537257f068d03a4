"""The small gray images of a frame that direct alignment uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform
from ssiam.motion import kernel
from ssiam.motion.kernel import ReductionKernel

_LONGER_SIDE: Final = 320  # px of the finest level: accurate, and too coarse for small waves


@dataclass(frozen=True, eq=False)
class Pyramid:
    """A gray frame at 320, 80 and 40 pixels along the longer side; (H, W) uint8 each."""

    fine: Image
    coarse: Image
    tiny: Image

    @property
    def levels(self) -> tuple[Image, Image, Image]:
        """All three, the finest first."""
        return self.fine, self.coarse, self.tiny


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
        tiny_wh = (self.coarse_wh[0] + 1) // 2, (self.coarse_wh[1] + 1) // 2
        self._kernel: ReductionKernel | None = None
        if kernel.is_used():
            level_whs = self.fine_wh, self.coarse_wh, tiny_wh
            self._kernel = ReductionKernel(size_wh, level_whs)

    def in_units(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert boxes (N, 4) low xy, high xy from pixels of the frame to units."""
        scaled: NDArray[np.float64] = (boxes - self._center_twice) / self.frame_from_unit[0, 0]
        return scaled

    def from_frame(self, frame: Image, reuse: Pyramid | None = None) -> Pyramid:
        """The pyramid of a frame, (H, W, 3) uint8 BGR or (H, W) uint8.

        `reuse` is a pyramid that is not needed any more: its arrays may be overwritten.
        """
        if self._kernel is not None:
            pyramid = reuse or Pyramid(*self._kernel.new_levels())
            self._kernel.reduce(frame, pyramid.levels)
            return pyramid
        gray = as_gray(np.asarray(cv2.resize(frame, self.fine_wh), dtype=np.uint8))
        return self.from_fine(np.asarray(cv2.GaussianBlur(gray, (3, 3), 0), dtype=np.uint8))

    def from_fine(self, fine: Image) -> Pyramid:
        """The pyramid above a finest level (H, W) uint8."""
        if self._kernel is not None:
            pyramid = Pyramid(fine, *self._kernel.new_levels()[1:])
            self._kernel.reduce_fine(pyramid.levels)
            return pyramid
        coarse = cv2.pyrDown(cv2.pyrDown(fine))
        tiny = cv2.pyrDown(coarse)
        return Pyramid(fine, *(np.asarray(level, dtype=np.uint8) for level in (coarse, tiny)))


def as_gray(image: Image) -> Image:
    """An image (H, W, 3) uint8 BGR, or (H, W) or (H, W, 1) uint8, as (H, W) uint8."""
    if image.ndim == 2:
        return image
    if image.shape[2] == 1:
        return image[..., 0]
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
