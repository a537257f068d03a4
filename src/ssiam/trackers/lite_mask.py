"""From the mask of a whole search crop to that of the picture, and to the target's turn."""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Points, corners_from_xywh, iou, xywh_from_corners
from ssiam.runtime import Tensor
from ssiam.trackers.mask_boxes import SMALLEST_AREA, rectangle_box

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]
Span: TypeAlias = tuple[Floats, Floats]  # first pixels and ends, across and down

_SEARCH: Final = 255  # px, side of the search crop
_STRIDE: Final = 4  # px of the crop in a cell of the mask
_HALF: Final = 127  # of 255, a probability of one half
_REACH: Final = 1.2  # times the box's width and height
_FILLED: Final = 0.25  # of a small box that its mask must cover more than
_AGREE: Final = 0.8  # overlap from which the mask is believed about the target's turn


def crop_corner(center_xy: tuple[float, float], side: int) -> Floats:
    """Left and top edge (2,) of the square that `FrameView.crop` cuts: whole pixels."""
    return np.floor(np.asarray(center_xy) - (side + 1) / 2 + 0.5)


class PastedMask(NamedTuple):
    """The part of a picture in which a mask may lie.

    Attributes
    ----------
    part : (h, w) bool
    corner_xy : (int, int)
        The part's first pixel, pixels of the picture.
    """

    part: Mask
    corner_xy: tuple[int, int]

    def inside(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) of a whole picture of this width and height."""
        width, height = size_wh
        whole = np.zeros((height, width), dtype=np.bool_)
        left, top = self.corner_xy
        x, y = max(left, 0), max(top, 0)
        shown = self.part[y - top : max(height - top, 0), x - left : max(width - left, 0)]
        whole[y : y + shown.shape[0], x : x + shown.shape[1]] = shown
        return whole


def pasted(
    logits: Tensor,
    center_xy: tuple[float, float],
    crop_side: int,
    xywh: XYWH,
    size_wh: tuple[int, int],
    margin: int = 0,
) -> PastedMask:
    """The mask of the target where its box lies in the picture.

    Parameters
    ----------
    logits : (1, 1, 64, 64) float32
        More than 0 on the target. Cell (i, j) covers pixels 4 i to 4 i + 3 and 4 j to 4 j + 3 of
        the crop.
    center_xy : (x, y)
        Centre of the search region, pixels of the picture.
    crop_side : int
        Its side, likewise.
    xywh : (x, y, w, h)
        The target's box, likewise; far from it the mask shows something else.
    size_wh : (int, int)
        The picture's width and height.
    margin : int
        Pixels around the picture, where the mask shows as well.

    Returns
    -------
    PastedMask
        True where the probability of the logits, between cells as well, is more than a half.
    """
    probability = (127.5 + 127.5 * np.tanh(logits[0, 0] / 2)).astype(np.uint8)
    zoom = crop_side / _SEARCH  # picture's pixels by the crop's
    scale = _STRIDE * zoom
    corner = crop_corner(center_xy, crop_side)
    crop = corner - np.ceil(scale), corner + np.ceil(crop_side + 2 * scale)
    first, last = _shared(crop, _around(xywh), (np.full(2, -margin), np.add(size_wh, margin)))
    width, height = np.maximum(last - first, 1).astype(int).tolist()
    # Pixel p of the crop shows corner + (p + 0.5) * zoom - 0.5.
    x, y = corner + scale / 2 - 0.5 - first
    part_from_mask = np.array([[scale, 0.0, x], [0.0, scale, y]])
    part = np.asarray(cv2.warpAffine(probability, part_from_mask, (width, height))) > _HALF
    return PastedMask(part, (int(first[0]), int(first[1])))


def turned_box(mask: PastedMask, xywh: XYWH) -> Points:
    """Corners (4, 2) of the mask's rotated box, if it agrees with the upright one; else of that."""
    upright = corners_from_xywh(xywh)
    _, _, w, h = xywh
    found = rectangle_box(mask.part, min(SMALLEST_AREA, _FILLED * w * h))
    if found is None:
        return upright
    turned = found + mask.corner_xy
    agree = iou(xywh_from_corners(turned), xywh) >= _AGREE
    return turned if agree else upright


def _around(xywh: XYWH) -> Span:
    """Where the mask of a target with this box may lie."""
    size = np.array(xywh[2:])
    low = np.floor(xywh[:2] - (_REACH - 1) / 2 * size)
    return low, low + np.ceil(_REACH * size) + 1


def _shared(*spans: Span) -> Span:
    """What lies in all of them; where nothing does, an end is not above its start."""
    return np.maximum.reduce([low for low, _ in spans]), np.minimum.reduce([to for _, to in spans])
