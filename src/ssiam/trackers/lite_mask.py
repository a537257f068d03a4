"""The mask of `lite`: from the logits of a search crop to a mask of the frame and a rotated box."""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Points, corners_from_xywh, iou, xywh_from_corners
from ssiam.runtime import Tensor
from ssiam.trackers.rotated_boxes import MIN_AREA, rectangle_box

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]
Span: TypeAlias = tuple[Floats, Floats]  # first pixel (2,) and end (2,), x and y

_SEARCH_SIDE: Final = 255  # px, side of the search crop
_STRIDE: Final = 4  # px of the crop in a cell of the mask
_HALF: Final = 127  # of 255: a probability of one half
_REACH: Final = 1.2  # width and height of the area in which the mask is used, in the box's
_MIN_FILL: Final = 0.25  # minimum share of a small box that its mask covers
_MIN_IOU: Final = 0.8  # minimum IoU of the rotated box's bounds with the upright box


def crop_corner(center_xy: tuple[float, float], side: int) -> Floats:
    """Left and top edge (2,) of the square that `FrameView.crop` cuts out, whole pixels."""
    return np.floor(np.asarray(center_xy) - (side + 1) / 2 + 0.5)


class PastedMask(NamedTuple):
    """A mask of the part of the frame around the target.

    Attributes
    ----------
    part : (h, w) bool
    corner_xy : (int, int)
        The part's first pixel in the frame, may be outside of it.
    """

    part: Mask
    corner_xy: tuple[int, int]

    def full(self, size_wh: tuple[int, int]) -> Mask:
        """The mask (H, W) of the whole frame of this width and height."""
        width, height = size_wh
        whole = np.zeros((height, width), dtype=np.bool_)
        left, top = self.corner_xy
        x, y = max(left, 0), max(top, 0)
        visible = self.part[y - top : max(height - top, 0), x - left : max(width - left, 0)]
        whole[y : y + visible.shape[0], x : x + visible.shape[1]] = visible
        return whole


def pasted_mask(
    logits: Tensor,
    center_xy: tuple[float, float],
    crop_side: int,
    xywh: XYWH,
    size_wh: tuple[int, int],
    margin: int = 0,
) -> PastedMask:
    """The mask of the target around its box.

    Parameters
    ----------
    logits : (1, 1, 64, 64) float32
        Positive on the target. Cell (i, j) covers pixels 4 i to 4 i + 3 and 4 j to 4 j + 3 of the
        crop.
    center_xy : (x, y)
        Center of the search region, frame pixels.
    crop_side : int
        Its side, frame pixels.
    xywh : (x, y, w, h)
        The target's box, frame pixels. The mask is cut off a bit outside of it, because it may
        show other objects there.
    size_wh : (int, int)
        The frame's width and height.
    margin : int
        Pixels around the frame to which the mask extends.

    Returns
    -------
    PastedMask
        True where the probability, interpolated between cells, is more than a half.
    """
    zoom = crop_side / _SEARCH_SIDE  # frame pixels per crop pixel
    scale = _STRIDE * zoom
    corner = crop_corner(center_xy, crop_side)
    crop = corner - np.ceil(scale), corner + np.ceil(crop_side + 2 * scale)
    span = intersection(crop, _around(xywh), visible_span(size_wh, margin))
    return paste(logits[0, 0], corner, np.full(2, scale), span)


def visible_span(size_wh: tuple[int, int], margin: int) -> Span:
    """The pixels of a frame of this width and height with a margin on each side."""
    return np.full(2, -margin), np.add(size_wh, margin)


def paste(logits: Tensor, corner_xy: Floats, cell_wh: Floats, span: Span) -> PastedMask:
    """The part of a mask in a span of the frame, at least one pixel wide and high.

    Parameters
    ----------
    logits : (n, n) float32
        Positive on the target.
    corner_xy : (2,) float64
        Top left corner of the first cell, frame pixels.
    cell_wh : (2,) float64
        Width and height of a cell, frame pixels.
    span : Span
        Whole pixels.
    """
    probability = (127.5 + 127.5 * np.tanh(logits / 2)).astype(np.uint8)
    first, end = span
    width, height = np.maximum(end - first, 1).astype(int).tolist()
    # The center of pixel p is at p + 0.5.
    (across, down), (x, y) = cell_wh, corner_xy + cell_wh / 2 - 0.5 - first
    part_from_mask = np.array([[across, 0.0, x], [0.0, down, y]])
    part = np.asarray(cv2.warpAffine(probability, part_from_mask, (width, height))) > _HALF
    return PastedMask(part, (int(first[0]), int(first[1])))


def rotated_box(mask: PastedMask, xywh: XYWH) -> Points:
    """Corners (4, 2) of the mask's rotated box, or of the upright box if the two disagree."""
    upright = corners_from_xywh(xywh)
    _, _, w, h = xywh
    found = rectangle_box(mask.part, min(MIN_AREA, _MIN_FILL * w * h))
    if found is None:
        return upright
    rotated = found + mask.corner_xy
    agrees = iou(xywh_from_corners(rotated), xywh) >= _MIN_IOU
    return rotated if agrees else upright


def _around(xywh: XYWH) -> Span:
    """The pixels around a target's box in which its mask is used."""
    size = np.array(xywh[2:])
    low = np.floor(xywh[:2] - (_REACH - 1) / 2 * size)
    return low, low + np.ceil(_REACH * size) + 1


def intersection(*spans: Span) -> Span:
    """The pixels in all of the spans; if there are none, the end is at or below the start."""
    starts, ends = [start for start, _ in spans], [end for _, end in spans]
    return np.maximum.reduce(starts), np.minimum.reduce(ends)
