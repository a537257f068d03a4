"""OpenCV's own trackers: CSRT, KCF and MIL. They need no weights, and see whole pictures."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import cv2

from ssiam.geometry import XYWH
from ssiam.stabilize import FrameView
from ssiam.trackers.base import pixel_box
from ssiam.trackers.track import Track

OpenCvName: TypeAlias = Literal["csrt", "kcf", "mil"]

_CREATE: dict[OpenCvName, Any] = {
    "csrt": cv2.TrackerCSRT.create,
    "kcf": cv2.TrackerKCF.create,
    "mil": cv2.TrackerMIL.create,
}


class OpenCvTracker:
    """One of OpenCV's trackers on the rendered view.

    They tell no score, only whether they still have the target: 1 or 0. When they have not, the
    last box is kept. CSRT and KCF repeat their results; OpenCV seeds MIL's samples from the clock,
    so its runs differ by a pixel or so.

    Parameters
    ----------
    name : {"csrt", "kcf", "mil"}
    """

    def __init__(self, name: OpenCvName) -> None:
        self._name: OpenCvName = name
        self._tracker: Any = None
        self._xywh: XYWH = (0.0, 0.0, 0.0, 0.0)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Start on `xywh`, rounded to whole pixels as OpenCV wants it."""
        picture = view.render()
        x, y, w, h = xywh
        box = pixel_box(
            (x + view.border, y + view.border, w, h), (picture.shape[1], picture.shape[0])
        )
        self._tracker = _CREATE[self._name]()
        self._tracker.init(picture, box)
        self._xywh = xywh

    def track(self, view: FrameView) -> Track:
        """The target in the next view."""
        found, (x, y, w, h) = self._tracker.update(view.render())
        if not found or w <= 0 or h <= 0:
            return Track(self._xywh, score=0.0, lost=True)
        # The border is an offset of the rendered picture (eq. 9).
        self._xywh = float(x - view.border), float(y - view.border), float(w), float(h)
        return Track(self._xywh)

    def another(self) -> OpenCvTracker:
        """A second tracker of the same kind."""
        return OpenCvTracker(self._name)
