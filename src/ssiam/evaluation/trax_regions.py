"""Regions of the TraX protocol: the box to start on, and the answer in every frame.

The official toolkit draws a polygon with its borders and a rectangle as w by h pixels, so that an
exact rectangle overlaps a polygon by .95 only. A target that was given as a polygon is therefore
answered with polygons, whose right and lower corners are the last pixels (x + w - 1): that undoes
`area_preserving_xywh`. One that was given as a rectangle is answered with rectangles.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, area_preserving_xywh, corners_from_xywh
from ssiam.track import Track


def start_box(region: Any) -> XYWH:
    """The upright box (x, y, w, h), pixels, of a `trax.Rectangle` or a `trax.Polygon`.

    Raises
    ------
    ArgumentError
        It is neither.
    """
    if region.type not in ("rectangle", "polygon"):
        raise ArgumentError(f"a target of the kind {region.type!r}: give a rectangle or a polygon")
    if _is_rectangle(region):
        x, y, w, h = region.bounds()
        return x, y, w, h
    points = np.array(list(region), dtype=np.float32)
    if len(points) != 4:
        points = np.asarray(cv2.boxPoints(cv2.minAreaRect(points)))
    return area_preserving_xywh(points)


def answer(track: Track, start: Any) -> Any:
    """The track as a region of the kind of `start`; of mask trackers always their rotated box."""
    import trax

    x, y, w, h = track.box
    if track.corners is not None:
        corners = track.corners
    elif _is_rectangle(start):
        return trax.Rectangle.create(x, y, w, h)
    else:
        corners = corners_from_xywh((x, y, w - 1, h - 1))
    return trax.Polygon.create([(float(x), float(y)) for x, y in corners])


def _is_rectangle(region: Any) -> bool:
    return bool(region.type == "rectangle")
