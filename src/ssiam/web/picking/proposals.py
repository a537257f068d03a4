"""`BoxProposer`: the box of the object at a clicked point, by the mask branch of `lite`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from ssiam.geometry import XYWH, Image, iou
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import FrameView
from ssiam.trackers.lite import SEARCH_SIDE, SHIPPED, LiteNetworks
from ssiam.trackers.lite_mask import crop_corner
from ssiam.trackers.siamese import (
    TEMPLATE_SIDE,
    Floats,
    TargetState,
    boxes_from_distances,
    crop_tensor,
    grid_points,
    sigmoid,
)

# Templates that are tried around the point: sides in pixels from the smallest to a share of the
# frame's shorter side, and width / height. Chosen on frames 20, 45 and 70 of the sequences whose
# first frames benchmarks/accuracy/click.py measures.
_SMALLEST: Final = 16.0
_LARGEST_SHARE: Final = 0.5
_SIZES: Final = 7
_ASPECTS: Final = (0.5, 1.0, 2.0)

_SIDE: Final = 32  # cells of the score map
_STRIDE: Final = 8  # px between them, in the search crop
_MASK_SIDE: Final = 64  # cells of the mask
_MASK_STRIDE: Final = 4  # px of the crop in one of them
_FALLBACK_SHARE: Final = 1 / 6  # side of the box where no mask covers the point, in the frame's


@dataclass(frozen=True)
class _Candidate:
    """What one template finds: the box at the point, and the bounds of the mask there."""

    box: XYWH
    mask_box: XYWH

    @property
    def agreement(self) -> float:
        """IoU of the two, 0..1."""
        return float(iou(self.box, self.mask_box))


class BoxProposer:
    """Proposes a box for a clicked point.

    Threads: any number may share it.

    The click says where an object is, but not how large it is. Templates of several sizes and
    shapes are taken around the point, and each is searched for in the same frame. A template whose
    box and mask agree has probably found an object; the object is the one that the masks of most
    templates agree on. The networks are always those of `lite`, whichever tracker is used.

    Parameters
    ----------
    threads : int
        CPU threads of the networks.
    """

    def __init__(self, threads: int = 1) -> None:
        self._networks = LiteNetworks.load(SHIPPED, RuntimeOptions(threads=threads))
        self._points = grid_points((np.arange(_SIDE) - (_SIDE - 1) / 2) * _STRIDE)

    def propose(self, image: Image, point_xy: tuple[float, float]) -> XYWH:
        """The box of the object at a point; a square around it if none is recognized.

        Parameters
        ----------
        image : (H, W, 3) uint8 BGR
        point_xy : (x, y)
            Pixels of the image.

        Returns
        -------
        (x, y, w, h)
            Inside of the image.
        """
        height, width = image.shape[:2]
        shorter = min(width, height)
        sides = np.geomspace(_SMALLEST, max(_SMALLEST, _LARGEST_SHARE * shorter), _SIZES)
        fill: Floats = image.mean(axis=(0, 1))
        found = []
        for side in sides:
            for aspect in _ASPECTS:
                size_wh = float(side * aspect**0.5), float(side / aspect**0.5)
                candidate = self._try(FrameView(image), point_xy, size_wh, fill)
                if candidate is not None:
                    found.append(candidate)
        if not found:
            side = shorter * _FALLBACK_SHARE
            box = point_xy[0] - side / 2, point_xy[1] - side / 2, side, side
            return _inside(box, width, height)
        return _inside(_most_supported(found).box, width, height)

    def _try(
        self,
        view: FrameView,
        point_xy: tuple[float, float],
        size_wh: tuple[float, float],
        fill: Floats,
    ) -> _Candidate | None:
        """What a template of this size finds at the point; None if no mask covers it."""
        context = TargetState(point_xy, size_wh).context_side
        template = view.crop(point_xy, round(context), TEMPLATE_SIDE, fill)
        (kernel,) = self._networks.template(crop_tensor(template))
        side = round(SEARCH_SIDE / TEMPLATE_SIDE * context)
        crop = view.crop(point_xy, side, SEARCH_SIDE, fill)
        scores, qualities, distances, logits = self._networks.search(crop_tensor(crop), kernel)
        zoom = SEARCH_SIDE / side
        corner = crop_corner(point_xy, side)
        boxes = boxes_from_distances(distances, self._points) / zoom
        boxes[:2] += (corner + side / 2)[:, None]
        covers = (np.abs(boxes[:2] - np.reshape(point_xy, (2, 1))) < boxes[2:] / 2).all(axis=0)
        mask_box = _mask_box(logits[0, 0] > 0, (np.asarray(point_xy) - corner) * zoom)
        if mask_box is None or not covers.any():
            return None
        best = int(np.argmax(np.where(covers, sigmoid(scores) * sigmoid(qualities), -1.0)))
        cx, cy, w, h = boxes[:, best].tolist()
        left, top, mask_w, mask_h = (value / zoom for value in mask_box)
        placed = left + float(corner[0]), top + float(corner[1]), mask_w, mask_h
        return _Candidate((cx - w / 2, cy - h / 2, w, h), placed)


def _mask_box(mask: np.ndarray, point_xy: Floats) -> XYWH | None:
    """Bounds of the mask's part at a point, crop pixels; None if the mask is not there."""
    column, row = np.clip(point_xy // _MASK_STRIDE, 0, _MASK_SIDE - 1).astype(int)
    if not mask[row, column]:
        return None
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    x, y, w, h, _ = (float(value) * _MASK_STRIDE for value in stats[labels[row, column]])
    return x, y, w, h


def _most_supported(candidates: list[_Candidate]) -> _Candidate:
    """The candidate whose box and mask agree, and whose mask most others agree with."""

    def support(candidate: _Candidate) -> float:
        others = sum(float(iou(candidate.mask_box, each.mask_box)) for each in candidates)
        return candidate.agreement * others

    return max(candidates, key=support)


def _inside(box: XYWH, width: int, height: int) -> XYWH:
    """The part of a box that is in an image of this size."""
    x, y, w, h = box
    left, top = max(0.0, x), max(0.0, y)
    right, bottom = min(float(width), x + w), min(float(height), y + h)
    return left, top, max(1.0, right - left), max(1.0, bottom - top)
