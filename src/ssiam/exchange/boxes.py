"""Boxes as annotation tools hold them: upright ones that are turned by an angle, and rounded."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from ssiam.exchange.annotations import Annotation, Corners

_DECIMALS: Final = 3  # of pixels and degrees


@dataclass(frozen=True)
class TurnedBox:
    """A box of width `w` and height `h` (pixels), turned about its centre.

    `degrees` are clockwise on screen, -45 to 45.
    """

    cx: float
    cy: float
    w: float
    h: float
    degrees: float

    @property
    def upright_xy(self) -> tuple[float, float]:
        """Top left corner of the box before it is turned."""
        return self.cx - self.w / 2, self.cy - self.h / 2

    @property
    def turned_xy(self) -> tuple[float, float]:
        """Where that corner comes to lie."""
        cos, sin = math.cos(math.radians(self.degrees)), math.sin(math.radians(self.degrees))
        x, y = -self.w / 2, -self.h / 2
        return self.cx + cos * x - sin * y, self.cy + sin * x + cos * y


def turned_box(annotation: Annotation) -> TurnedBox:
    """The target's rotated box, or its upright one, turned by nothing."""
    if annotation.corners is not None:
        return _from_corners(annotation.corners)
    x, y, w, h = annotation.xywh
    return TurnedBox(x + w / 2, y + h / 2, w, h, 0.0)


def _from_corners(corners: Corners) -> TurnedBox:
    """The box of four corners in order around it; of no rectangle, one of its mean sides."""
    (x1, y1), (x2, y2), (x3, y3), (x4, y4) = corners
    along = ((x2 - x1 + x3 - x4) / 2, (y2 - y1 + y3 - y4) / 2)
    across = ((x4 - x1 + x3 - x2) / 2, (y4 - y1 + y3 - y2) / 2)
    w, h = math.hypot(*along), math.hypot(*across)
    degrees = math.degrees(math.atan2(along[1], along[0]))
    # Four angles tell the same box; the smallest is the one that people would draw.
    quarters = math.floor(degrees / 90 + 0.5)
    if quarters % 2:
        w, h = h, w
    centre = (x1 + x2 + x3 + x4) / 4, (y1 + y2 + y3 + y4) / 4
    return TurnedBox(*centre, w, h, degrees - 90 * quarters)


def rounded(values: Iterable[float], decimals: int = _DECIMALS) -> list[float]:
    """The values rounded, none of them -0.0."""
    return [round(value, decimals) + 0.0 for value in values]


def full_circle(degrees: float) -> float:
    """Degrees rounded, from 0 to below 360."""
    return round(degrees, _DECIMALS) % 360
