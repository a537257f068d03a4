"""Distractors are recognized by their positions, even when they match the template better."""

import numpy as np
import pytest

from ssiam.trackers.distractors import DistractorTracker
from ssiam.trackers.siamese import TargetState

SIDE, STEP = 32, 8  # cells, and view pixels between them
SIZE = 60.0  # px, of the target
TARGET, DISTRACTOR = (100.0, 124.0), (180.0, 116.0)
POSITIONS = np.stack(np.meshgrid(*[np.arange(SIDE) * STEP + 4.0] * 2), axis=-1).reshape(-1, 2)


def score_map(*objects):
    """Scores (n,) of a map with a peak for each object (x, y, score)."""
    peaks = [
        score * np.exp(-(((POSITIONS - (x, y)) / 10) ** 2).sum(axis=1)) for x, y, score in objects
    ]
    return np.max([np.zeros(SIDE**2), *peaks], axis=0)


def cell(xy):
    return int(np.linalg.norm(POSITIONS - xy, axis=1).argmin())


def flags(tracker, score, target_xy):
    return tracker.detect(POSITIONS, score, TargetState(target_xy, (SIZE, SIZE))).is_distractor


def best_of(tracker, target_xy, *objects):
    """The best candidate that is not a distractor, which becomes the target."""
    score = score_map(*objects)
    candidates = tracker.detect(POSITIONS, score, TargetState(target_xy, (SIZE, SIZE)))
    best = int(np.where(candidates.is_distractor, -1, score).argmax())
    tracker.update(candidates, best)
    return best


@pytest.fixture
def tracker():
    """After five frames of a target and a distractor."""
    tracker = DistractorTracker()
    for _ in range(5):
        assert best_of(tracker, TARGET, (*TARGET, 0.6), (*DISTRACTOR, 0.3)) == cell(TARGET)
    return tracker


def test_a_distractor_with_a_higher_score_for_once_is_excluded(tracker):
    assert best_of(tracker, TARGET, (*TARGET, 0.3), (*DISTRACTOR, 0.7)) == cell(TARGET)


def test_without_a_visible_target_no_distractor_is_excluded(tracker):
    """The distractor may be the target: a wrong choice must be reversible."""
    assert best_of(tracker, TARGET, (*TARGET, 0.02), (*DISTRACTOR, 0.7)) == cell(DISTRACTOR)


def test_distractors_are_tracked(tracker):
    (x, y), (target_x, target_y) = DISTRACTOR, TARGET
    for t in range(1, 8):
        now = (target_x, target_y - 8 * t)
        assert best_of(tracker, now, (*now, 0.5), (x, y + 16 * t, 0.3)) == cell(now)
    assert best_of(tracker, now, (*now, 0.3), (x, y + 128, 0.8)) == cell(now)


def test_a_distractor_that_was_hidden_for_a_moment_is_remembered(tracker):
    for _ in range(3):
        best_of(tracker, TARGET, (*TARGET, 0.6))
    assert best_of(tracker, TARGET, (*TARGET, 0.3), (*DISTRACTOR, 0.7)) == cell(TARGET)


def test_a_target_may_jump_to_an_empty_position(tracker):
    assert best_of(tracker, TARGET, (40, 40, 0.7), (*DISTRACTOR, 0.3)) == cell((40, 40))


def test_a_higher_score_over_many_frames_makes_it_the_target(tracker):
    for _ in range(12):
        best = best_of(tracker, TARGET, (*TARGET, 0.2), (*DISTRACTOR, 0.6))
    assert best == cell(DISTRACTOR)


def test_next_to_a_target_of_low_score_nothing_is_excluded():
    """The target may be hidden behind the object that is visible at its position."""
    tracker = DistractorTracker()
    for _ in range(8):
        best_of(tracker, TARGET, (*TARGET, 0.32), (*DISTRACTOR, 0.15))
    assert best_of(tracker, TARGET, (*TARGET, 0.32), (*DISTRACTOR, 0.5)) == cell(DISTRACTOR)


def test_a_new_peak_is_not_a_distractor():
    tracker = DistractorTracker()
    best_of(tracker, TARGET, (*TARGET, 0.6), (*DISTRACTOR, 0.3))
    assert best_of(tracker, TARGET, (*TARGET, 0.3), (*DISTRACTOR, 0.7)) == cell(DISTRACTOR)


def test_candidates_near_the_target_are_never_excluded(tracker):
    (x, y), (target_x, target_y) = DISTRACTOR, TARGET
    adjacent_x = target_x + 0.6 * SIZE
    for t in np.linspace(0, 1, 8):
        moving = (x + t * (adjacent_x - x), y + t * (target_y - y), 0.3)
        best_of(tracker, TARGET, (*TARGET, 0.6), moving)
    excluded = flags(tracker, score_map((*TARGET, 0.3), (adjacent_x, target_y, 0.7)), TARGET)
    assert excluded[cell((adjacent_x, target_y))]
    nearer = np.linalg.norm(POSITIONS - TARGET, axis=1) < 0.2 * SIZE
    assert not excluded[nearer].any()


def test_an_empty_map_has_no_distractors(tracker):
    assert not flags(tracker, score_map(), TARGET).any()


def test_detection_does_not_change_the_tracker(tracker):
    score = score_map((*TARGET, 0.3), (*DISTRACTOR, 0.7))
    first = flags(tracker, score, TARGET)
    assert (flags(tracker, score, TARGET) == first).all()
