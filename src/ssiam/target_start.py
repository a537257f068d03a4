"""`TargetStart`: where and when a target is first given."""

from __future__ import annotations

from dataclasses import dataclass

from ssiam.geometry import XYWH


@dataclass(frozen=True)
class TargetStart:
    """The box of a target in the frame in which it is first given.

    Attributes
    ----------
    frame : int
        Index of the frame in the source, from 0.
    xywh : (float, float, float, float)
        x, y, width, height of the box in raw pixels of that frame, (x, y) its top left corner.
    """

    frame: int
    xywh: XYWH
