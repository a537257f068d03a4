"""`Track`: the result of a tracker for one frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Points, Transform, map_box, map_mask, map_points
from ssiam.motion import Motion


@dataclass(frozen=True, eq=False)
class Track:
    """The target in one frame.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    box : (x, y, w, h) floats
        Upright box, raw-frame pixels, 0-based.
    score : float
        0..1: confidence score, the probability that the IoU of the box with the target exceeds 0.5
        (`ssiam.trackers.confidence`); SiamFC, SiamRPN and SiamMask give their own score.
    lost : bool
        Whether the target is lost; the box is then a guess that should not be displayed.
    corners : (4, 2) float64 or None
        Rotated box of the mask trackers, raw-frame pixels.
    mask : (H, W) bool or None
        The target's pixels, for the mask trackers.
    motion : Motion or None
        Camera motion to this frame; None with ``stabilize="off"``.
    stab_from_raw : (3, 3) float64 or None
        Stabilization of this frame, M_t of eq. 7; None with ``stabilize="off"``.
    evidence : tuple of float
        The numbers from which the score was computed; each tracker has different ones.
    """

    box: XYWH
    score: float = 1.0
    lost: bool = False
    corners: Points | None = None
    mask: NDArray[np.bool_] | None = None
    motion: Motion | None = None
    stab_from_raw: Transform | None = None
    evidence: tuple[float, ...] = ()

    def mapped(self, to_from_from: Transform, size_wh: tuple[int, int]) -> Track:
        """Map box, corners and mask to a frame of `size_wh` = (width, height) pixels (eq. 9)."""
        return replace(
            self,
            box=map_box(to_from_from, self.box),
            corners=None if self.corners is None else map_points(to_from_from, self.corners),
            mask=None if self.mask is None else map_mask(to_from_from, self.mask, size_wh),
        )
