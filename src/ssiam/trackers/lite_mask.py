"""From the mask of a whole search crop to that of the picture."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.runtime import Tensor

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]

_SEARCH: Final = 255  # px, side of the search crop
_STRIDE: Final = 4  # px of the crop in a cell of the mask
_HALF: Final = 127  # of 255, a probability of one half


def crop_corner(centre_xy: tuple[float, float], side: int) -> Floats:
    """Left and top edge (2,) of the square that `FrameView.crop` cuts: whole pixels."""
    return np.floor(np.asarray(centre_xy) - (side + 1) / 2 + 0.5)


def pasted(
    logits: Tensor,
    centre_xy: tuple[float, float],
    crop_side: int,
    size_wh: tuple[int, int],
    margin: int = 0,
) -> Mask:
    """The mask where the search crop lies in the picture, nothing around it.

    Parameters
    ----------
    logits : (1, 1, 64, 64) float32
        Cell (i, j) covers pixels 4 i to 4 i + 3 and 4 j to 4 j + 3 of the crop.
    centre_xy : (x, y)
        Centre of the search region, pixels of the picture.
    crop_side : int
        Its side, likewise.
    size_wh : (int, int)
        The picture's width and height.
    margin : int
        Pixels added on each side, where the mask shows as well.

    Returns
    -------
    (H + 2 * margin, W + 2 * margin) bool
        Where the probability is more than a half.
    """
    probability = (127.5 + 127.5 * np.tanh(logits[0, 0] / 2)).astype(np.uint8)
    zoom = crop_side / _SEARCH  # picture's pixels by the crop's
    # Pixel p of the crop shows corner + (p + 0.5) * zoom - 0.5.
    x, y = crop_corner(centre_xy, crop_side) + _STRIDE / 2 * zoom - 0.5 + margin
    scale = _STRIDE * zoom
    width, height = size_wh
    whole = width + 2 * margin, height + 2 * margin
    picture_from_mask = np.array([[scale, 0.0, x], [0.0, scale, y]])
    return np.asarray(cv2.warpAffine(probability, picture_from_mask, whole)) > _HALF
