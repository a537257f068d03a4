"""OpenCV's own trackers: CSRT, KCF and MIL. They need no weights, and see whole pictures."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, Final, Literal, TypeAlias

import cv2

from ssiam.copying import DeepCopied
from ssiam.errors import ArgumentError, CopyError, TrackingError, one_line
from ssiam.geometry import XYWH
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.appearance import Appearance
from ssiam.trackers.base import pixel_box
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.mil import RepeatableMil

OpenCvName: TypeAlias = Literal["csrt", "kcf", "mil"]

_CREATE: dict[OpenCvName, Any] = {
    "csrt": cv2.TrackerCSRT.create,
    "kcf": cv2.TrackerKCF.create,
    "mil": RepeatableMil,
}
_CONFIDENCE: Final[dict[OpenCvName, Confidence]] = {  # of likeness to the first and recent look
    "csrt": Confidence((7.2, 3.9), -6.2),
    "kcf": Confidence((6.3, 1.4), -4.9),
    "mil": Confidence((7.2, 3.9), -6.2),
}
_LEARNT: Final = 0.6  # score from which a box is taken as the recent look
_TAKEN: Final = 0.4  # score from which a place that was found is taken
_REACH: Final = 0.7  # target sizes around the place where it is looked for
# Longer sides of the last box, on each of its sides, that are drawn: all that they look at.
_SEEN: Final[dict[OpenCvName, float]] = {"csrt": 8.0, "kcf": 3.0, "mil": 3.0}
_SEEN_MORE: Final = 40.0  # px that are drawn beyond these


class OpenCvTracker(DeepCopied):
    """One of OpenCV's trackers on the rendered view.

    They tell no score, only whether they still have the target, and MIL not even that: the score
    is that of the box's `Appearance`. When they have not, the last box is kept.
    All repeat their results; of MIL, `RepeatableMil` says how.

    Threads: one thread at a time for each object; MIL trackers wait for each other.

    Parameters
    ----------
    name : {"csrt", "kcf", "mil"}
    """

    def __init__(self, name: OpenCvName) -> None:
        self._name: OpenCvName = name
        self._tracker: Any = None
        self._xywh: XYWH = (0.0, 0.0, 0.0, 0.0)

    def __deepcopy__(self, memo: dict[int, Any]) -> OpenCvTracker:
        if self._tracker is not None:
            raise CopyError(
                f"a tracker {self._name} that has a target cannot be copied, as OpenCV cannot: "
                "start another one where the target is"
            )
        return self.another()

    @property
    def doubt(self) -> float | None:
        """KCF finds little by itself; the others know better than an `Appearance`."""
        return 0.2 if self._name == "kcf" else None

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Start on `xywh`, rounded to whole pixels as OpenCV wants it.

        Raises
        ------
        ArgumentError
            OpenCV cannot start on this box: it is too thin, too small or too large. What was
            followed before is kept.
        """
        appearance = Appearance(view, xywh)
        self._start(view, xywh)
        self._appearance = appearance

    def track(self, view: FrameView) -> Track:
        """The target in the next view.

        Raises
        ------
        TrackingError
            OpenCV refuses this view.
        """
        picture = view.render(self._surroundings)
        try:
            found, (x, y, w, h) = self._tracker.update(picture)
        except cv2.error as error:
            reason = getattr(error, "err", None) or one_line(error)
            raise TrackingError(f"{self._name} failed on this frame: {reason}") from error
        if not found or w <= 0 or h <= 0:
            return Track(self._xywh, score=0.0)
        # The border is an offset of the rendered picture (eq. 9).
        self._xywh = float(x - view.border), float(y - view.border), float(w), float(h)
        track = self._judged(view, self._xywh)
        if track.score > _LEARNT:
            self._appearance.learn(view, self._xywh)
        return track

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The place most like the target around `xywh`; followed from there if it is it."""
        track = self._judged(view, self._appearance.find(view, xywh, _REACH))
        if track.score > _TAKEN and _inside(track.box, view):
            with suppress(ArgumentError):
                self._start(view, track.box)
        return track

    def another(self) -> OpenCvTracker:
        """A second tracker of the same kind."""
        return OpenCvTracker(self._name)

    @property
    def _surroundings(self) -> XYWH:
        x, y, w, h = self._xywh
        reach = _SEEN[self._name] * max(w, h) + _SEEN_MORE
        return x - reach, y - reach, w + 2 * reach, h + 2 * reach

    def _start(self, view: FrameView, xywh: XYWH) -> None:
        picture = view.render()
        x, y, w, h = xywh
        box = pixel_box(
            (x + view.border, y + view.border, w, h), (picture.shape[1], picture.shape[0])
        )
        tracker = _CREATE[self._name]()
        try:
            tracker.init(picture, box)
        except cv2.error as error:
            height, width = picture.shape[:2]
            raise ArgumentError(
                f"{self._name} cannot follow a box of {box[2]}x{box[3]} pixels in frames of "
                f"{width}x{height}: it is too thin, too small or too large for it; draw another "
                "box, or take another tracker"
            ) from error
        self._tracker, self._xywh = tracker, xywh

    def _judged(self, view: FrameView, xywh: XYWH) -> Track:
        evidence = self._appearance.likeness(view, xywh)
        return Track(xywh, score=_CONFIDENCE[self._name].probability(evidence), evidence=evidence)


def _inside(xywh: XYWH, view: FrameView) -> bool:
    """Whether the middle of a box lies well within the rendered picture."""
    x, y, w, h = xywh
    n, (width, height) = view.border, view.size_wh
    return (
        x + n + w / 4 >= 0
        and y + n + h / 4 >= 0
        and (x + 3 * w / 4 <= width + n and y + 3 * h / 4 <= height + n)
    )
