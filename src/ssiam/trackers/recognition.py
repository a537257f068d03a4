"""`TargetRecognition`: whether an object is the target, by the features of templates.

As in the template memory (THOR), features are relative to the target's surroundings, so that one
limit fits the features of all networks. They are compared when a box may be on another object:
after frames without a likely box, after a cut, and in the search of a lost target. Nothing is
tracked with them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.stabilize import FrameView
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.template_memory import beside, relative_feature

Floats = NDArray[np.float64]

_MIN_SCORE: Final = 0.8  # from which a box is a sample of the target
_FIRST_INTERVAL, _MAX_INTERVAL = 10, 80  # frames between two samples; doubled each time
_MAX_SAMPLES: Final = 6
_MIN_SIMILARITY: Final = 0.35
_SHARE: Final = 0.7  # of the samples' own similarity that the target must have


class TargetRecognition(DeepCopied):
    """Samples of the target's features, and the comparison with an object.

    Threads: one thread at a time for each object; several objects are independent.
    """

    def __init__(self) -> None:
        self._beside: list[Floats] = []  # features of the surroundings
        self._samples: list[Floats] = []  # unit vectors relative to them
        self._own: list[float] = []  # similarity of each sample to those before it
        self._interval = _FIRST_INTERVAL
        self._age = 0
        self._is_possible = True  # until a tracker without features, or without clones, is seen

    def observe(self, tracker: CompleteTracker, view: FrameView, xywh: XYWH, score: float) -> None:
        """Take a sample of the target in `xywh`, view pixels, if it is time for one.

        At most one feature is computed in a frame. Nothing is compared if the tracker has no
        template feature or cannot be cloned.
        """
        self._age += 1
        if score < _MIN_SCORE or not self._is_possible:
            return
        if not self._beside:
            self._is_possible = _is_comparable(tracker)
            if not self._is_possible:
                return
        if len(self._beside) < 4:
            self._beside.append(_feature(tracker, view, beside(xywh)[len(self._beside)]))
        elif not self._samples:
            self._samples.append(self._relative(tracker.template_feature()))
            self._age = 0
        elif self._age >= self._interval:
            sample = self._relative(_feature(tracker, view, xywh))
            self._own.append(self._similarity(sample))
            kept = self._samples[1:][-(_MAX_SAMPLES - 2) :]
            self._samples = [self._samples[0], *kept, sample]
            self._interval, self._age = min(2 * self._interval, _MAX_INTERVAL), 0

    def is_target(self, tracker: CompleteTracker, view: FrameView, xywh: XYWH) -> bool:
        """Whether the object in `xywh`, view pixels, is as similar as the target has to be.

        True as long as there is nothing to compare with.
        """
        if not self._own:
            return True
        similarity = self._similarity(self._relative(_feature(tracker, view, xywh)))
        return similarity > max(_MIN_SIMILARITY, _SHARE * float(np.median(self._own)))

    def _relative(self, feature: Floats) -> Floats:
        return relative_feature(feature, np.asarray(np.mean(self._beside, axis=0)))

    def _similarity(self, sample: Floats) -> float:
        return max(float(sample @ each) for each in self._samples)


def _is_comparable(tracker: CompleteTracker) -> bool:
    if not tracker.has_template_feature:
        return False
    try:
        tracker.clone()
    except ArgumentError:  # a class that cannot be called without arguments
        return False
    return True


def _feature(tracker: CompleteTracker, view: FrameView, xywh: XYWH) -> Floats:
    """The features of a template in `xywh`."""
    started = tracker.clone()
    started.init(view, xywh)
    return started.template_feature()
