"""dlib's correlation tracker (Danelljan et al., BMVC 2014), which needs no weights."""

from __future__ import annotations

import math
from typing import Any, Final, Literal, TypeAlias

import cv2
import numpy as np

from ssiam.errors import ArgumentError, CopyError, MissingExtraError
from ssiam.geometry import XYWH, Image
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker

DlibName: TypeAlias = Literal["dlib"]

# Peak to side-lobe ratio whose score is 0.5: at about 7 a target is occluded or lost (Bolme et al.,
# Visual Object Tracking using Adaptive Correlation Filters, CVPR 2010, section 3.5).
_HALF_SCORE: Final = 7.0
_SPAN: Final = 1.5  # of the ratio, for a step of 1 of the score's logit
_MIN_SIDE: Final = 2.0  # px, of a box: dlib takes no smaller one


class DlibTracker(CompleteTracker):
    """dlib's correlation tracker on the rendered view.

    The score is made of dlib's peak to side-lobe ratio; it is not calibrated. A tracker that has a
    target cannot be copied.

    Threads: one thread at a time for each object.

    Raises
    ------
    MissingExtraError
        dlib is not installed.
    """

    center_inset = 0.0
    score_is_calibrated = False

    def __init__(self) -> None:
        self._dlib = _dlib()
        self._tracker: Any = None

    def __deepcopy__(self, memo: dict[int, Any]) -> DlibTracker:
        if self._tracker is not None:
            raise CopyError(
                "a tracker dlib that has a target cannot be copied, since dlib's cannot be: start "
                "a new one on the target's box"
            )
        return self.clone()

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Start on `xywh`.

        Raises
        ------
        ArgumentError
            The box is too small for dlib.
        """
        if min(xywh[2:]) < _MIN_SIDE:
            raise ArgumentError(
                f"dlib cannot track a box of {xywh[2]:g}x{xywh[3]:g} pixels: draw it larger, or "
                "choose another tracker"
            )
        tracker = self._dlib.correlation_tracker()
        tracker.start_track(_rgb(view), self._rectangle(view, xywh))
        self._tracker = tracker

    def update(self, view: FrameView) -> Track:
        """The target in the next view."""
        return self._track(view, self._started.update(_rgb(view)))

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, searched around `xywh`."""
        ratio = self._started.update(_rgb(view), self._rectangle(view, xywh))
        return self._track(view, ratio)

    def clone(self) -> DlibTracker:
        """A tracker of the same kind without a target."""
        return DlibTracker()

    @property
    def _started(self) -> Any:
        if self._tracker is None:
            raise ArgumentError("no target yet: call init(view, xywh) before update or seek")
        return self._tracker

    def _rectangle(self, view: FrameView, xywh: XYWH) -> Any:
        """A box in pixels of the rendered image, in dlib's form."""
        x, y, w, h = xywh
        n = view.border
        return self._dlib.drectangle(x + n, y + n, x + n + w, y + n + h)

    def _track(self, view: FrameView, ratio: float) -> Track:
        """The track at dlib's position; `ratio` is the peak to side-lobe ratio."""
        found, n = self._tracker.get_position(), view.border
        w, h = (max(side, _MIN_SIDE) for side in (found.width(), found.height()))
        ratio = max(float(np.nan_to_num(ratio)), 0.0)
        score = 0.5 + 0.5 * math.tanh((ratio - _HALF_SCORE) / _SPAN / 2)
        return Track((found.left() - n, found.top() - n, w, h), score, evidence=(ratio,))


def _rgb(view: FrameView) -> Image:
    return np.asarray(cv2.cvtColor(view.render(), cv2.COLOR_BGR2RGB), dtype=np.uint8)


def _dlib() -> Any:
    try:
        import dlib
    except ImportError as error:
        raise MissingExtraError(
            "tracker dlib needs the package dlib: pip install 'ssiam[dlib]'"
        ) from error
    return dlib
