"""The mask of the object in a box, by `ssiam.networks.box_mask`, computed when it is first read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from ssiam.geometry import XYWH, Image
from ssiam.runtime import Network
from ssiam.stabilize import FrameView
from ssiam.track import Outline, PendingOutline
from ssiam.trackers.lite_mask import (
    Floats,
    intersection,
    paste,
    rotated_box,
    visible_span,
)
from ssiam.trackers.siamese import crop_tensor

CROP_SIDE: Final = 128  # px, side of the network's input
CONTEXT: Final = 1.6  # width and height of the crop, in those of the box
_CELL: Final = 2  # px of the crop in a cell of the mask


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
        crop_xywh = _enlarged(xywh)
        crop = view.crop_rectangle(crop_xywh, (CROP_SIDE, CROP_SIDE), fill)
        return PendingOutline(partial(self._outline, crop, crop_xywh, xywh, view.size_wh, margin))

    def _outline(
        self, crop: Image, crop_xywh: XYWH, xywh: XYWH, size_wh: tuple[int, int], margin: int
    ) -> Outline:
        (logits,) = self.network(crop_tensor(crop))
        threshold = math.log(self.threshold / (1 - self.threshold))
        corner, sides = np.array(crop_xywh[:2]), np.array(crop_xywh[2:])
        crop_span = np.floor(corner), np.ceil(corner + sides)
        span = intersection(crop_span, visible_span(size_wh, margin))
        mask = paste(logits[0, 0] - threshold, corner, sides / CROP_SIDE * _CELL, span)
        return Outline(rotated_box(mask, xywh), mask.full(size_wh))


def _enlarged(xywh: XYWH) -> XYWH:
    x, y, w, h = xywh
    return x - (CONTEXT - 1) / 2 * w, y - (CONTEXT - 1) / 2 * h, CONTEXT * w, CONTEXT * h
