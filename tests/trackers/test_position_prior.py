"""Candidates far from the predicted position are ranked lower."""

import numpy as np
import pytest

from helpers.synthetic import world
from ssiam import StabilizedTracker, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.position_prior import near_prediction
from ssiam.trackers.responses import Response

BOX = (100.0, 80.0, 30.0, 30.0)
FAR = 50.0  # px from the target to the look-alike, 1.7 target sizes


def response(*candidates):
    """Candidates (x, y, rank) of 30x30 pixels."""
    x, y, ranked = np.array(candidates, float).T
    size = np.full(len(x), 30.0)
    boxes = np.stack([x + 15, y + 15, size, size])
    return Response(boxes, ranked, ranked, lambda: [x == each for each in x], None)


def test_the_rank_is_halved_at_the_halving_distance():
    candidates = response((100, 80, 1.0), (115, 80, 1.0), (100, 50, 1.0), (145, 80, 1.0))
    near = near_prediction(candidates, BOX, error=0.0)  # halved at half a target size
    assert near.ranked == pytest.approx([1, 1 / 2, 1 / 5, 1 / 10])
    wide = near_prediction(candidates, BOX, error=0.1)  # one and a half target sizes
    assert wide.ranked == pytest.approx([1, 0.9, 1 / (1 + (2 / 3) ** 2), 1 / 2])
    assert near.score is candidates.score


def test_the_best_candidate_is_that_of_the_new_ranks():
    candidates = response((160, 80, 0.9), (102, 80, 0.4))
    assert candidates.best == 0
    assert near_prediction(candidates, BOX, error=0.0).best == 1


class TwoOfAKind(CompleteTracker):
    """Sees the target with a low score and, from the tenth frame on, a better look-alike."""

    has_responses = True

    def __init__(self):
        self.frames = 0

    def init(self, view, xywh):
        self.xywh = xywh

    def update(self, view):
        found = self.respond(view)
        return self.accept(view, found, found.best)

    def seek(self, view, xywh):
        return Track(self.xywh, 0.0)

    def clone(self):
        return TwoOfAKind()

    def respond(self, view):
        self.frames += 1
        x, y = BOX[:2]
        other = [(x + FAR, y, 0.9)] if self.frames > 10 else []
        return response((x, y, 0.5), *other)

    def accept(self, view, found, index):
        self.xywh = found.xywh(index)
        return Track(self.xywh, float(found.score[index]))


class WithoutPreference(TwoOfAKind):
    """The same, whose own ranks decide."""

    prefers_prediction = False


@pytest.mark.parametrize(
    ("kind", "option", "prefer"),
    [(TwoOfAKind, True, True), (TwoOfAKind, False, False), (WithoutPreference, True, False)],
)
def test_a_look_alike_far_from_the_prediction_is_not_taken(kind, option, prefer):
    frame = world(1, (320, 240))
    tracker = StabilizedTracker(kind(), StabilizerConfig("predict").with_options(prefer=option))
    tracker.init(frame, BOX)
    boxes = [tracker.update(frame).box for _ in range(14)]
    assert boxes[8] == pytest.approx(BOX)
    assert boxes[-1][0] == pytest.approx(BOX[0] if prefer else BOX[0] + FAR)
