"""From the logits of SiamMask's refinement to a probability for every pixel of the picture."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH
from ssiam.runtime import Tensor
from ssiam.trackers.anchors import STRIDE
from ssiam.trackers.siamese import EXEMPLAR

MASK_SIDE: Final = 127  # px of the network's mask


def probabilities(logits: Tensor) -> Tensor:
    """Sigmoid of logits (1, 127 * 127), row by row -> (127, 127) float32."""
    half = logits.reshape(MASK_SIDE, MASK_SIDE).astype(np.float64) / 2
    return np.asarray((1 + np.tanh(half)) / 2, dtype=np.float32)


def mask_square(
    center_xy: tuple[float, float], crop_side: int, cell: tuple[int, int], instance: int, base: int
) -> XYWH:
    """The square of the picture that the mask of one cell (row, column) covers.

    Parameters
    ----------
    center_xy : (x, y)
        Centre of the search region.
    crop_side : int
        Its side, in the same pixels as the result.
    cell : (int, int)
    instance : int
        Its side in the crop's pixels.
    base : int
        BASE_SIZE of pysot, `SiamRpnParameters.base`.
    """
    scale = crop_side / instance
    row, column = ((index - base // 2) * STRIDE * scale for index in cell)
    left, top = (c - crop_side / 2 for c in center_xy)
    return left + column, top + row, EXEMPLAR * scale, EXEMPLAR * scale


def paste(mask: Tensor, square_xywh: XYWH, size_wh: tuple[int, int], margin: int = 0) -> Tensor:
    """A mask's values where it lies in the picture, zero around it.

    The reference (`crop_back` of pysot) shrinks everything by (size - 1) / size about the
    square's corner; that is kept.

    Parameters
    ----------
    mask : (127, 127) float32
    square_xywh : (x, y, w, h)
        Where the mask lies, pixels of the picture.
    size_wh : (int, int)
        The picture's width and height.
    margin : int
        Pixels added on each side, where the mask shows as well.

    Returns
    -------
    (H + 2 * margin, W + 2 * margin) float32
    """
    width, height = size_wh
    whole = (width + 2 * margin, height + 2 * margin)
    shifted = _picture_from_mask(square_xywh, size_wh) + np.array([0.0, 0.0, margin])
    return np.asarray(
        cv2.warpAffine(mask, shifted, whole, flags=cv2.INTER_LINEAR), dtype=np.float32
    )


def _picture_from_mask(square_xywh: XYWH, size_wh: tuple[int, int]) -> NDArray[np.float64]:
    """(2, 3), in the reference's order of operations."""
    x, y, w, _ = square_xywh
    zoom = MASK_SIDE / w
    scales = [(length - 1) / (length * zoom) for length in size_wh]
    shifts = [scale * (start * zoom) for scale, start in zip(scales, (x, y), strict=True)]
    return np.array([[scales[0], 0.0, shifts[0]], [0.0, scales[1], shifts[1]]])
