"""`TemplateMemoryTracker`: a tracker with a memory of further templates of its target.

After Sauer et al., "Tracking Holistic Object Representations" (THOR, BMVC 2019). The first template
is always kept. Long-term templates are those that differ most from each other: a new one is taken
only if it raises the determinant of the Gram matrix of all templates' features, and if it is
similar enough to the first one. Short-term templates are the newest ones, and are dropped when the
target's appearance changes too much. A template is a clone of the tracker that was started on a box
of high score, so the memory works around every tracker that can be cloned and can seek.

Unlike in THOR, one further template searches in a frame, and only if the first one's score is not
high; similarities are relative to the target's surroundings in the first frame, which makes one
limit fit the features of all networks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, iou
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker, ViewTracker
from ssiam.trackers.foreign import complete

Floats = NDArray[np.float64]

_BESIDE: Final = 1.5  # target sizes from the target to the boxes that show its surroundings
_PATCH: Final = 16  # px, side of the image patch that replaces features of a network
_MIN_LENGTH: Final = 1e-9  # of a feature that can be compared


@dataclass(frozen=True)
class MemoryParameters:
    """When templates are taken and used; see benchmarks/calibration/template_memory.py.

    Attributes
    ----------
    long_term : int
        Largest number of long-term templates, the first one included.
    short_term : int
        Largest number of short-term templates.
    interval : int
        Frames between two templates.
    min_score : float
        Score from which a box is trusted as a template, 0..1.
    search_below : float
        Score of the first template's box up to which a second one searches, 0..1.
    margin : float
        By which the second box must have a higher score, 0..1.
    min_similarity : float
        Similarity to the first template from which a template is taken into the long-term memory.
        Of the surroundings in later frames of the ten test sequences, 95 % are less similar.
    min_novelty : float
        Smallest factor of the determinant with an additional template, 0..1.
    max_diversity : float
        Diversity of the short-term templates above which they are dropped, 0..1.
    drop_below : float
        Score below which the short-term templates are dropped, 0..1.
    same_object : float
        IoU from which two boxes show the same object.
    """

    long_term: int = 5
    short_term: int = 2
    interval: int = 10
    min_score: float = 0.8
    search_below: float = 0.8
    margin: float = 0.1
    min_similarity: float = 0.3
    min_novelty: float = 0.1
    max_diversity: float = 0.6
    drop_below: float = 0.25
    same_object: float = 0.5


PARAMETERS: Final = MemoryParameters()


def selected_slot(
    features: Sequence[Floats], feature: Floats, capacity: int, min_novelty: float
) -> int | None:
    """The position at which a new feature increases the diversity of the features; None if none.

    Diversity is the determinant of the Gram matrix of the features (eq. 2 of THOR): the squared
    volume that they span.

    Parameters
    ----------
    features : sequence of (n,) float64
        Unit vectors; the first one is never replaced.
    feature : (n,) float64
        Unit vector.
    capacity : int
        Largest number of features.
    min_novelty : float
        If the features are fewer: smallest factor of the determinant with the new one added.

    Returns
    -------
    int or None
        Index of the feature to replace, or the number of features to append the new one.
    """
    before = _volume(features)
    if len(features) < capacity:
        return len(features) if _volume([*features, feature]) >= min_novelty * before else None
    volumes = [
        _volume([*features[:index], feature, *features[index + 1 :]])
        for index in range(1, len(features))
    ]
    best = int(np.argmax(volumes)) + 1 if volumes else 0
    return best if volumes and volumes[best - 1] > before else None


def diversity(features: Sequence[Floats]) -> float:
    """One minus the mean similarity of all pairs of unit vectors; 0 for less than two."""
    if len(features) < 2:
        return 0.0
    gram = _gram(features)
    return float(1 - gram[np.triu_indices(len(features), 1)].mean())


@dataclass
class _Template:
    tracker: CompleteTracker
    feature: Floats  # unit vector, relative to the surroundings


@dataclass
class _Target:
    """State of the target."""

    xywh: XYWH  # as last reported, the view's pixels
    surroundings: Floats  # mean feature beside the target in the first frame
    first: Floats  # feature of the first template, as in `_Template`
    long_term: list[_Template] = field(default_factory=list)  # without the first one
    short_term: list[_Template] = field(default_factory=list)  # the newest last
    age: int = 0  # frames since the last template was taken
    turn: int = 0  # counts the searches of further templates
    tracker_is_elsewhere: bool = False  # the tracker's last box is not the reported one

    @property
    def features(self) -> list[Floats]:
        """The features of the first and the long-term templates."""
        return [self.first, *(each.feature for each in self.long_term)]

    def next_template(self) -> _Template | None:
        """The newest short-term template and the long-term ones, in turn."""
        templates = [*self.short_term[-1:], *self.long_term]
        if not templates:
            return None
        self.turn += 1
        return templates[self.turn % len(templates)]


class TemplateMemoryTracker(CompleteTracker):
    """Any tracker that can seek, with a short-term and a long-term memory of templates.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Features are those of the tracker's `template_feature`, or without such a method the pixels of
    a small image patch.

    Parameters
    ----------
    tracker : ViewTracker
    parameters : MemoryParameters, optional

    Raises
    ------
    ArgumentError
        The tracker cannot seek.
    """

    def __init__(self, tracker: ViewTracker, parameters: MemoryParameters = PARAMETERS) -> None:
        completed = complete(tracker)
        if not completed.can_seek:
            raise ArgumentError(
                f"{completed.name} cannot search around a given box: leave the template memory out"
            )
        self._tracker = completed
        self._parameters = parameters
        self._target_or_none: _Target | None = None

    @property
    def score_is_calibrated(self) -> bool:
        """As for the tracker."""
        return self._tracker.score_is_calibrated

    @property
    def runs_networks(self) -> bool:
        """As for the tracker."""
        return self._tracker.runs_networks

    @property
    def reseek_below(self) -> float:
        """As for the tracker."""
        return self._tracker.reseek_below

    @property
    def center_inset(self) -> float:
        """As for the tracker."""
        return self._tracker.center_inset

    @property
    def template_count(self) -> tuple[int, int]:
        """Number of long-term templates, the first one included, and of short-term templates."""
        target = self._target
        return 1 + len(target.long_term), len(target.short_term)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the object in `xywh` as the target, and forget all templates."""
        self._tracker.init(view, xywh)
        around = [self._feature(view, each) for each in beside(xywh)]
        surroundings = np.asarray(np.mean(around, axis=0))
        first = relative_feature(self._feature(view, xywh, self._tracker), surroundings)
        self._target_or_none = _Target(xywh, surroundings, first)

    def update(self, view: FrameView) -> Track:
        """The target in the next view: the box of the first or of one further template."""
        target, last = self._target, self._target.xywh
        elsewhere = target.tracker_is_elsewhere
        first = self._tracker.seek(view, last) if elsewhere else self._tracker.update(view)
        track = self._best(view, first, last)
        self._learn(view, track)
        return track

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, searched around `xywh`; no template is taken from it."""
        return self._best(view, self._tracker.seek(view, xywh), xywh)

    def clone(self) -> TemplateMemoryTracker:
        """A tracker of the same kind without a target, which shares the networks."""
        return TemplateMemoryTracker(self._tracker.clone(), self._parameters)

    def similarity(self, view: FrameView, xywh: XYWH) -> float:
        """Similarity of the object in `xywh` to the most similar long-term template.

        Parameters
        ----------
        view : FrameView
        xywh : (x, y, w, h)
            The view's pixels.

        Returns
        -------
        float
            -1..1: 1 for a template itself, about 0 for what was beside the target at first.
        """
        target = self._target
        relative = relative_feature(self._feature(view, xywh), target.surroundings)
        return max(inner_product(relative, each) for each in target.features)

    @property
    def _target(self) -> _Target:
        if self._target_or_none is None:
            raise ArgumentError("no target yet: call init(view, xywh) before update or seek")
        return self._target_or_none

    def _started(self, view: FrameView, xywh: XYWH) -> CompleteTracker:
        """A clone whose template is in `xywh`."""
        tracker = self._tracker.clone()
        tracker.init(view, xywh)
        return tracker

    def _feature(
        self, view: FrameView, xywh: XYWH, started: CompleteTracker | None = None
    ) -> Floats:
        """The features of a template in `xywh`; `started` is a tracker that has this template."""
        if self._tracker.has_template_feature:
            return (started or self._started(view, xywh)).template_feature()
        x, y, w, h = xywh
        side = max(round(max(w, h)), 1)
        patch = view.crop_square((x + w / 2, y + h / 2), side, _PATCH, np.zeros(3))
        return patch.ravel().astype(np.float64)

    def _best(self, view: FrameView, first: Track, around_xywh: XYWH) -> Track:
        """The track of the first template, or that of a further one if it is better."""
        target = self._target
        best = self._of_further_template(view, first, around_xywh) or first
        target.xywh, target.tracker_is_elsewhere = best.box, best is not first
        return best

    def _of_further_template(
        self, view: FrameView, first: Track, around_xywh: XYWH
    ) -> Track | None:
        """The track of the template whose turn it is, if it is better than `first`.

        Its score must be higher, and a box on another object must be more similar to the memory.
        """
        parameters = self._parameters
        if first.score > parameters.search_below:
            return None
        template = self._target.next_template()
        if template is None:
            return None
        track = template.tracker.seek(view, around_xywh)
        if track.score < first.score + parameters.margin:
            return None
        if float(iou(first.box, track.box)) >= parameters.same_object:
            return track
        similarity = self.similarity(view, track.box)
        is_similar = similarity >= max(parameters.min_similarity, self.similarity(view, first.box))
        return track if is_similar else None

    def _learn(self, view: FrameView, track: Track) -> None:
        """Take a template from a trusted box, at most one in every interval."""
        target, parameters = self._target, self._parameters
        target.age += 1
        if track.score < parameters.drop_below:
            target.short_term = []
        if track.score < parameters.min_score or target.age < parameters.interval:
            return
        target.age = 0
        try:
            tracker = self._started(view, track.box)
        except ArgumentError:  # OpenCV's trackers refuse some boxes
            return
        feature = relative_feature(self._feature(view, track.box, tracker), target.surroundings)
        template = _Template(tracker, feature)
        self._learn_short_term(target, template)
        self._learn_long_term(target, template)

    def _learn_short_term(self, target: _Target, template: _Template) -> None:
        newest = [*target.short_term, template][-self._parameters.short_term :]
        is_stable = diversity([each.feature for each in newest]) <= self._parameters.max_diversity
        target.short_term = newest if is_stable else [template]

    def _learn_long_term(self, target: _Target, template: _Template) -> None:
        parameters = self._parameters
        # As in THOR the limit is lower while the appearance changes.
        changing = diversity([each.feature for each in target.short_term])
        similarity = inner_product(template.feature, target.first)
        if similarity < parameters.min_similarity * (1 - changing):
            return
        features = target.features
        slot = selected_slot(
            features, template.feature, parameters.long_term, parameters.min_novelty
        )
        if slot is not None:
            target.long_term[slot - 1 : slot] = [template]


def relative_feature(feature: Floats, surroundings: Floats) -> Floats:
    """Unit vector of a feature's difference from the surroundings; zeros if there is none."""
    difference = feature - surroundings
    length = math.sqrt(inner_product(difference, difference))
    return difference / length if length > _MIN_LENGTH else 0 * difference


def inner_product(one: Floats, other: Floats) -> float:
    """Inner product of two features (n,).

    BLAS shares long vectors among threads, and waits many milliseconds for them if the other cores
    are busy.
    """
    return float(np.einsum("i,i->", one, other))


def beside(xywh: XYWH) -> list[XYWH]:
    """Boxes of the target's size to the right, the left, below and above it."""
    x, y, w, h = xywh
    dx, dy = _BESIDE * w, _BESIDE * h
    return [(x + dx, y, w, h), (x - dx, y, w, h), (x, y + dy, w, h), (x, y - dy, w, h)]


def _gram(features: Sequence[Floats]) -> Floats:
    stacked = np.stack(features)
    return np.asarray(np.einsum("in,jn->ij", stacked, stacked))  # see `inner_product`


def _volume(features: Sequence[Floats]) -> float:
    return float(np.linalg.det(_gram(features)))
