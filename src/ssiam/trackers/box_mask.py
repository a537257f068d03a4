"""The mask of the object in a box, by `ssiam.networks.box_mask`, computed when it is first read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image, Points, corners_from_xywh, iou, xywh_from_corners
from ssiam.runtime import Network, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Outline, PendingOutline
from ssiam.trackers.rotated_boxes import MIN_AREA, rectangle_box
from ssiam.trackers.siamese import Floats, crop_tensor

Mask = NDArray[np.bool_]
Span: TypeAlias = tuple[Floats, Floats]  # first pixel (2,) and end (2,), x and y

CROP_SIDE: Final = 128  # px, side of the network's input
CONTEXT: Final = 1.6  # width and height of the crop, in those of the box
MASK_SHAPES: Final = (  # of the inputs and outputs of the network
    [(1, 3, CROP_SIDE, CROP_SIDE)],
    [(1, 1, CROP_SIDE // 2, CROP_SIDE // 2)],
)
CELL: Final = 2  # px of the crop in a cell of the mask
BOUNDS_THRESHOLDS: Final = (0.05, 0.12, 0.18, 0.27, 0.5)
"""Probabilities of a pixel; the bounds of `BoxMask.bounds` are those of the mask above each."""
_LEAST_PART: Final = 0.1  # area of a part of the mask, in that of the largest one, in its bounds
_HALF: Final = 127  # of 255: a probability of one half
_MIN_FILL: Final = 0.25  # minimum share of a small box that its mask covers
_MIN_IOU: Final = 0.8  # minimum IoU of the rotated box's bounds with the upright box


@dataclass(frozen=True)
class BoxMask:
    """Outlines of targets by their boxes.

    Threads: any number may share it.

    Parameters
    ----------
    network : Network
        Maps (1, 3, 128, 128) float32 BGR in 0..255 to logits (1, 1, 64, 64).
    threshold : float
        Probability above which a pixel belongs to the target.
    """

    network: Network
    threshold: float

    def outline(self, view: FrameView, xywh: XYWH, fill: Floats) -> PendingOutline:
        """The outline of the target in `xywh`, pixels of the view.

        Only the crop (128, 128, 3) is cut now. The network runs when the outline is read.

        Parameters
        ----------
        view : FrameView
        xywh : (x, y, w, h)
        fill : (3,) float64
            Color outside of the frame, BGR.
        """
        # A stabilized view shows parts of the raw frame beyond its own edges.
        margin = 0 if view.is_raw else view.border
        crop_xywh = enlarged(xywh)
        crop = view.crop(crop_xywh, (CROP_SIDE, CROP_SIDE), fill).image
        return PendingOutline(partial(self._outline, crop, crop_xywh, xywh, view.size_wh, margin))

    def bounds(self, view: FrameView, xywh: XYWH) -> Floats:
        """The bounds of the object in `xywh`, pixels of the view, by several thresholds.

        Small parts apart from the rest do not count.

        Parameters
        ----------
        view : FrameView
        xywh : (x, y, w, h)

        Returns
        -------
        (T, 4) float64
            x, y, w, h of the mask above each of `BOUNDS_THRESHOLDS`; nan where it is empty.
        """
        crop_xywh = enlarged(xywh)
        crop = view.crop(crop_xywh, (CROP_SIDE, CROP_SIDE), view.mean_color).image
        (logits,) = self.network(crop_tensor(crop))
        cells = np.array(
            [
                _cell_bounds(logits[0, 0] > math.log(threshold / (1 - threshold)))
                for threshold in BOUNDS_THRESHOLDS
            ]
        )
        cell_wh = np.array(crop_xywh[2:]) / CROP_SIDE * CELL
        return np.hstack([crop_xywh[:2] + cells[:, :2] * cell_wh, cells[:, 2:] * cell_wh])

    def _outline(
        self, crop: Image, crop_xywh: XYWH, xywh: XYWH, size_wh: tuple[int, int], margin: int
    ) -> Outline:
        (logits,) = self.network(crop_tensor(crop))
        threshold = math.log(self.threshold / (1 - self.threshold))
        corner, sides = np.array(crop_xywh[:2]), np.array(crop_xywh[2:])
        crop_span = np.floor(corner), np.ceil(corner + sides)
        span = intersection(crop_span, visible_span(size_wh, margin))
        mask = paste(logits[0, 0] - threshold, corner, sides / CROP_SIDE * CELL, span)
        return Outline(rotated_box(mask, xywh), mask.full(size_wh))


def _cell_bounds(mask: Mask) -> Floats:
    """x, y, w, h of the large parts of a mask, in cells; nan if it is empty."""
    _, _, parts, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    areas = parts[1:, cv2.CC_STAT_AREA]
    if not len(areas):
        return np.full(4, np.nan)
    large = parts[1:][areas >= _LEAST_PART * areas.max(), :4].astype(np.float64)
    first, end = large[:, :2].min(axis=0), (large[:, :2] + large[:, 2:]).max(axis=0)
    return np.concatenate([first, end - first])


def enlarged(xywh: XYWH) -> XYWH:
    """The rectangle that is cropped for a box (x, y, w, h), about the same center."""
    x, y, w, h = xywh
    return x - (CONTEXT - 1) / 2 * w, y - (CONTEXT - 1) / 2 * h, CONTEXT * w, CONTEXT * h


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


def intersection(*spans: Span) -> Span:
    """The pixels in all of the spans; if there are none, the end is at or below the start."""
    starts, ends = [start for start, _ in spans], [end for _, end in spans]
    return np.maximum.reduce(starts), np.minimum.reduce(ends)
