"""From the mask of a whole search crop to a probability for every pixel of the picture."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.runtime import Tensor
from ssiam.trackers.mask_paste import laid

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]

_SEARCH: Final = 255  # px, side of the search crop
_STRIDE: Final = 4  # px of the crop in a cell of the mask


def crop_corner(centre_xy: tuple[float, float], side: int) -> Floats:
    """Left and top edge (2,) of the square that `FrameView.crop` cuts: whole pixels."""
    return np.floor(np.asarray(centre_xy) - (side + 1) / 2 + 0.5)


def pasted(
    logits: Tensor,
    centre_xy: tuple[float, float],
    crop_side: int,
    size_wh: tuple[int, int],
    margin: int = 0,
) -> Tensor:
    """Probabilities where the search crop lies in the picture, zero around it.

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
    (H + 2 * margin, W + 2 * margin) float32
    """
    probability = np.asarray((1 + np.tanh(logits[0, 0] / 2)) / 2, dtype=np.float32)
    zoom = crop_side / _SEARCH  # picture's pixels by the crop's
    # Pixel p of the crop shows corner + (p + 0.5) * zoom - 0.5.
    shifts = crop_corner(centre_xy, crop_side) + _STRIDE / 2 * zoom - 0.5
    scale = _STRIDE * zoom
    picture_from_mask = np.array([[scale, 0.0, shifts[0]], [0.0, scale, shifts[1]]])
    return laid(probability, picture_from_mask, size_wh, margin)
