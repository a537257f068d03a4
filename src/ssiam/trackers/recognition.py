"""`TargetRecognition`: whether an object is the target, by the features of templates.

As in the template memory (THOR), features are relative to the target's surroundings, so that one
limit fits the features of all networks. They are compared when a box may be on another object:
after frames without a likely box, after a cut, and in the search of a lost target. `Evidence` adds
up the comparisons of successive frames. Nothing is tracked with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, center_distance
from ssiam.motion import Motion
from ssiam.stabilize import FrameView
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.colors import color_histogram, color_similarity
from ssiam.trackers.template_memory import beside, inner_product, relative_feature

Floats = NDArray[np.float64]

_MIN_SCORE: Final = 0.8  # from which a box is a sample of the target
_MAX_SAMPLES: Final = 8
_FIRST_INTERVAL, _MAX_INTERVAL = 8, 160  # frames between two; doubled each time from the last on
# From docs/decisions/0014-recognition-of-a-lost-target.md, as those of `Evidence`.
_OWN_SHARE: Final = 0.5  # of the samples' own similarity that counts as usual

# For `Evidence`.
_PER_LIKENESS: Final = 20.0  # evidence of one frame, by the likeness above the limit
_LEAST, _ENOUGH, _SURE = -1.0, 1.0, 2.0  # evidence
_SAME_OBJECT: Final = 0.7  # target sizes that an object may move between two comparisons
_MAX_SEEN: Final = 7  # objects besides the last one


class _Sample(NamedTuple):
    feature: Floats  # unit vector relative to the surroundings
    colors: Floats


class TargetRecognition(DeepCopied):
    """Samples of the target's features and colors, and the comparison with an object.

    Threads: one thread at a time for each object; several objects are independent.
    """

    def __init__(self) -> None:
        self._beside: list[Floats] = []  # features of the surroundings
        self._samples: list[_Sample] = []
        self._own: list[tuple[float, float]] = []  # similarity of each sample to those before it
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
            feature = self._relative(tracker.template_feature())
            self._samples.append(_Sample(feature, color_histogram(view, xywh)))
            self._age = 0
        elif self._age >= self._interval:
            self._age = 0
            sample = self._sample(tracker, view, xywh)
            # The last sample is so recent that the similarity to it is higher than usual.
            own = _similarity(sample, self._samples[:-1] or self._samples)
            self._own = [*self._own, own][-_MAX_SAMPLES:]
            if len(self._samples) == _MAX_SAMPLES:
                del self._samples[1]  # the first one is kept
                self._interval = min(2 * self._interval, _MAX_INTERVAL)
            self._samples.append(sample)

    @property
    def is_ready(self) -> bool:
        """Whether there is something to compare with."""
        return bool(self._own)

    def likeness(self, tracker: CompleteTracker, view: FrameView, xywh: XYWH) -> float:
        """How like the samples of the target the object in `xywh`, view pixels, is.

        Returns
        -------
        float
            Similarity of the features, less half of the similarity that they usually have to each
            other, less what the colors are less similar than usual.

        Only if `is_ready`.
        """
        feature, colors = _similarity(self._sample(tracker, view, xywh), self._samples)
        own_feature, own_colors = np.median(self._own, axis=0).tolist()
        return feature - _OWN_SHARE * float(own_feature) + min(colors / float(own_colors) - 1, 0.0)

    def _sample(self, tracker: CompleteTracker, view: FrameView, xywh: XYWH) -> _Sample:
        feature = self._relative(_feature(tracker, view, xywh))
        return _Sample(feature, color_histogram(view, xywh))

    def _relative(self, feature: Floats) -> Floats:
        return relative_feature(feature, np.asarray(np.mean(self._beside, axis=0)))


@dataclass
class _Seen:
    xywh: XYWH
    value: float


class Evidence(DeepCopied):
    """Evidence that objects are the target, from their likeness in successive frames.

    A high likeness suffices by itself, one close to the limit has to be repeated. The objects are
    told apart by their places, which move along with the scene.

    Threads: one thread at a time for each object; several objects are independent.

    Attributes
    ----------
    value : float
        Of the last object, from -1 to 2; it is recognized from 1 on.
    """

    def __init__(self) -> None:
        self.value = 0.0
        self._seen: list[_Seen] = []

    def advance(self, motion: Motion) -> None:
        """Move on to the next frame, reached by `motion`."""
        if motion.reliable:
            for each in self._seen:
                each.xywh = motion.map_box(each.xywh)
        else:
            self._seen = []

    def restart(self) -> None:
        """Forget all objects."""
        self._seen = []

    def add(self, xywh: XYWH, likeness: float, limit: float) -> bool:
        """Add the likeness of the object in `xywh`, raw-frame pixels, and `limit`, the neutral one.

        Returns whether the object is recognized.
        """
        near = [each for each in self._seen if center_distance(xywh, each.xywh) < _SAME_OBJECT]
        before = min(
            near, key=lambda each: center_distance(xywh, each.xywh), default=_Seen(xywh, 0.0)
        )
        value = before.value + _PER_LIKENESS * (likeness - limit)
        self.value = min(max(value, _LEAST), _SURE)
        others = [each for each in self._seen if each is not before]
        self._seen = [*others[-_MAX_SEEN:], _Seen(xywh, self.value)]
        return self.value >= _ENOUGH

    @property
    def is_sure(self) -> bool:
        """Whether the last object is recognized twice over."""
        return self.value >= _SURE


def _similarity(sample: _Sample, samples: Sequence[_Sample]) -> tuple[float, float]:
    """The highest similarity of the features, and of the colors, to one of the samples."""
    return (
        max(inner_product(sample.feature, each.feature) for each in samples),
        max(color_similarity(sample.colors, each.colors) for each in samples),
    )


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
