"""`CandidateTracker`: base of the Siamese trackers that list their candidates."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.distractors import DistractorTracker, ScoredCandidates
from ssiam.trackers.responses import Response
from ssiam.trackers.siamese import (
    Floats,
    SearchParameters,
    SiameseTracker,
    TargetState,
    TargetT,
    ranked_candidates,
)


class Details(NamedTuple):
    """What a `CandidateTracker` needs of a response to take one of its candidates."""

    candidates: ScoredCandidates
    boxes: Floats  # (4, n) cx, cy, w, h in px of the search crop
    penalty: Floats  # (n,)
    outputs: Any  # whatever else the tracker has computed


class CandidateTracker(SiameseTracker[TargetT]):
    """Base of the Siamese trackers that regress a box in each cell of their maps.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    A subclass lists its candidates with `_response`, and takes one with `_learning_rate`.

    Parameters
    ----------
    parameters : SearchParameters
    window : (n,) float64
        Cosine window of the candidates, 0..1.
    distractors : bool
        As for `SiameseTracker`.
    """

    has_responses = True
    prefers_prediction = True

    def __init__(self, parameters: SearchParameters, window: Floats, distractors: bool) -> None:
        super().__init__(distractors)
        self._parameters = parameters
        self._window = window

    def update(self, view: FrameView) -> Track:
        """The target in the next view."""
        response = self.respond(view)
        return self.accept(view, response, response.best)

    @abstractmethod
    def respond(self, view: FrameView) -> Response:
        """The candidates in the next view."""

    @abstractmethod
    def accept(self, view: FrameView, response: Response, index: int) -> Track:
        """Take a candidate as the target."""

    def _response(
        self,
        distractors: DistractorTracker,
        last: TargetState,
        score: Floats,
        boxes: tuple[Floats, Floats],
        last_wh: Floats,
        outputs: Any,
        *,
        anchors: int = 1,
    ) -> Response:
        """The candidates of a search crop, ranked.

        Parameters
        ----------
        distractors : DistractorTracker
            The target's.
        last : TargetState
            The target's last state, view pixels.
        score : (n,) float64
            0..1.
        boxes : pair of (4, n) float64
            cx, cy, w, h of the candidates, in pixels of the view and of the search crop.
        last_wh : (2,) float64
            The target's last size, pixels of the search crop.
        outputs : object
            What `accept` needs besides.
        anchors : int
            Candidates in each cell of the map.
        """
        view_boxes, crop_boxes = boxes
        candidates = distractors.detect(view_boxes[:2].T, score, last, anchors)
        ranked, penalty = ranked_candidates(
            crop_boxes, candidates.allowed_score, last_wh, self._window, self._parameters
        )
        details = Details(candidates, crop_boxes, penalty, outputs)
        return Response(view_boxes, score, ranked, candidates.groups, details)

    def _learning_rate(self, response: Response, index: int) -> float:
        """Share 0..1 of a candidate's size in the target's new one."""
        details: Details = response.details
        return float(details.penalty[index] * response.score[index] * self._parameters.lr)
