"""`Lettering`: outlined text whose size follows that of the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image

Color: TypeAlias = tuple[int, int, int]
BLACK: Color = (0, 0, 0)
WHITE: Color = (255, 255, 255)

_FONT = cv2.FONT_HERSHEY_SIMPLEX
# Font scale and line width at a picture of 720 rows; smaller pictures get relatively more.
_REFERENCE_ROWS = 720
_FONT_SCALE = 0.9
_SMALLEST_FONT_SCALE = 0.5
_LINE_WIDTH = 3.0
_SMALLEST_LINE_WIDTH = 2


@dataclass(frozen=True)
class Lettering:
    """Sizes for one picture, pixels: of letters, of lines and of the space between things."""

    font_scale: float
    thickness: int
    line_height: int
    gap: int

    @classmethod
    def for_image(cls, image: Image) -> Lettering:
        """Sizes that can be read in this picture from 240 rows to 4K."""
        share = min(image.shape[:2]) / _REFERENCE_ROWS
        font_scale = max(_SMALLEST_FONT_SCALE, _FONT_SCALE * share)
        thickness = max(_SMALLEST_LINE_WIDTH, round(_LINE_WIDTH * share))
        (_, height), baseline = cv2.getTextSize("0", _FONT, font_scale, thickness)
        return cls(font_scale, thickness, height + baseline + thickness, 2 + thickness)

    def width_of(self, text: str) -> int:
        """Width of the text with its outline."""
        (width, _), _ = cv2.getTextSize(text, _FONT, self.font_scale, self._bold)
        return width + 2 * self._rim

    def write(self, image: Image, text: str, lower_left: tuple[float, float], color: Color) -> None:
        """Write into the picture, moved as far as needed to lie inside of it.

        `lower_left` is the (x, y) of the line of text, the part under the letters included.
        """
        letters = self._letters(text)
        rows, columns = image.shape[:2]
        left = round(max(0.0, min(lower_left[0], columns - letters.shape[1])))
        top = round(max(0.0, min(lower_left[1], rows) - letters.shape[0]))
        part = image[top : top + letters.shape[0], left : left + letters.shape[1]]
        letters = letters[: part.shape[0], : part.shape[1]]
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * self._rim + 1,) * 2)
        _blend(part, cv2.dilate(letters, kernel), BLACK)
        _blend(part, letters, color)

    def _letters(self, text: str) -> NDArray[np.uint8]:
        """The text in white on black. OpenCV 5 widens bolder text, so it cannot be its outline."""
        (_, height), baseline = cv2.getTextSize(text, _FONT, self.font_scale, self._bold)
        size = height + baseline + 2 * self._rim, self.width_of(text)
        place = self._rim, height + self._rim
        patch = np.zeros(size, dtype=np.uint8)
        cv2.putText(patch, text, place, _FONT, self.font_scale, 255, self._bold, cv2.LINE_AA)
        return patch

    @property
    def _bold(self) -> int:
        """Width of the strokes; letters are finer than the lines of boxes."""
        return max(1, round(self.thickness / 2))

    @property
    def _rim(self) -> int:
        """Width of the dark outline."""
        return max(1, self.thickness // 2)


def _blend(part: Image, share: NDArray[Any], color: Color) -> None:
    """Lay the colour over a part of a picture, where and as far as `share` (0..255) says."""
    weight = share[..., None].astype(np.float32) / 255
    part[:] = np.round(part * (1 - weight) + weight * np.array(color, np.float32))
