"""`BoxProposer`: the box of the object at a clicked point, by the mask network of `lite`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import WeightsError
from ssiam.geometry import XYWH, Image, iou
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import FrameView
from ssiam.trackers.box_mask import CELL, CROP_SIDE, enlarged
from ssiam.trackers.lite import SHIPPED, LiteNetworks
from ssiam.trackers.siamese import Floats

# Boxes from which the search begins: sides in pixels from the smallest to a share of the frame's
# shorter side, and width / height. Chosen on frames 20, 45 and 70 of the sequences whose first
# frames benchmarks/accuracy/click.py measures.
_SMALLEST: Final = 16.0
_LARGEST_SHARE: Final = 0.5
_SIZES: Final = 7
_ASPECTS: Final = (0.5, 1.0, 2.0)
_ROUNDS: Final = 3  # masks of each box; after each, the box is replaced by the mask's bounds

_MIN_SIDE: Final = 4.0  # px; smaller masks are noise
_FALLBACK_SHARE: Final = 1 / 6  # side of the box where no mask covers the point, in the frame's


@dataclass(frozen=True)
class _Candidate:
    """The bounds of a mask at the point, and of the one that was found in these bounds."""

    box: XYWH
    again: XYWH

    @property
    def stability(self) -> float:
        """IoU of the two, 0..1."""
        return float(iou(self.box, self.again))


class BoxProposer:
    """Proposes a box for a clicked point.

    Threads: any number may share it.

    The click says where an object is, but not how large it is. Boxes of several sizes and shapes
    are put around the point. In each the mask network segments the object, and the box is replaced
    by the bounds of its mask. A box that stays the same has probably found an object; the object is
    the one that most boxes end at. The networks are always those of `lite`, whichever tracker is
    used.

    Parameters
    ----------
    threads : int
        CPU threads of the network.
    """

    def __init__(self, threads: int = 1) -> None:
        network = LiteNetworks.load(SHIPPED, RuntimeOptions(threads=threads)).mask
        if network is None:
            raise WeightsError(f"weights {SHIPPED} have no mask network: install ssiam again")
        self._network = network

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
        view = FrameView(image)
        found = []
        for side in sides:
            for aspect in _ASPECTS:
                w, h = float(side * aspect**0.5), float(side / aspect**0.5)
                start = point_xy[0] - w / 2, point_xy[1] - h / 2, w, h
                candidate = self._refine(view, point_xy, start, view.mean_color)
                if candidate is not None:
                    found.append(candidate)
        if not found:
            side = shorter * _FALLBACK_SHARE
            start = point_xy[0] - side / 2, point_xy[1] - side / 2, side, side
            return _inside(start, width, height)
        return _inside(_most_supported(found).again, width, height)

    def _refine(
        self, view: FrameView, point_xy: tuple[float, float], start: XYWH, fill: Floats
    ) -> _Candidate | None:
        """Where a box ends; None if a mask on the way does not cover the point."""
        box, again = start, start
        for _ in range(_ROUNDS):
            box, found = again, self._mask_box(view, point_xy, again, fill)
            if found is None:
                return None
            again = found
        return _Candidate(box, again)

    def _mask_box(
        self, view: FrameView, point_xy: tuple[float, float], box: XYWH, fill: Floats
    ) -> XYWH | None:
        """Bounds of the part at the point of the mask in a box; None if it is not there."""
        left, top, width, height = enlarged(box)
        crop = view.crop((left, top, width, height), (CROP_SIDE, CROP_SIDE), fill)
        (logits,) = self._network(crop.tensor())
        shares = np.array([(point_xy[0] - left) / width, (point_xy[1] - top) / height])
        found = _part_at(logits[0, 0] > 0, shares * CROP_SIDE / CELL)
        if found is None:
            return None
        box = crop.box_in_view([CELL * side for side in found])
        return box if min(box[2:]) >= _MIN_SIDE else None


def _part_at(mask: NDArray[np.bool_], cell_xy: Floats) -> XYWH | None:
    """Bounds of the connected part of a mask at a cell, cells; None if the mask is not there."""
    column, row = np.clip(cell_xy, 0, mask.shape[0] - 1).astype(int)
    if not mask[row, column]:
        return None
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    x, y, w, h, _ = (float(value) for value in stats[labels[row, column]])
    return x, y, w, h


def _most_supported(candidates: list[_Candidate]) -> _Candidate:
    """The candidate that is stable, and at which most others end."""

    def support(candidate: _Candidate) -> float:
        others = sum(float(iou(candidate.again, each.again)) for each in candidates)
        return candidate.stability * others

    return max(candidates, key=support)


def _inside(box: XYWH, width: int, height: int) -> XYWH:
    """The part of a box that is in an image of this size."""
    x, y, w, h = box
    left, top = max(0.0, x), max(0.0, y)
    right, bottom = min(float(width), x + w), min(float(height), y + h)
    return left, top, max(1.0, right - left), max(1.0, bottom - top)
