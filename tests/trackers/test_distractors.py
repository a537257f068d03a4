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


def state(xy=TARGET, size=SIZE):
    return TargetState(xy, (size, size))


def learned(frames, target_score=0.6, other_score=0.3, other=DISTRACTOR):
    """After some frames with the same two objects."""
    tracker = DistractorTracker()
    for _ in range(frames):
        score = score_map((*TARGET, target_score), (*other, other_score))
        tracker.update(tracker.detect(POSITIONS, score, state()), cell(TARGET))
    return tracker


def excludes(tracker, *, other=DISTRACTOR, target=TARGET, target_score=0.6):
    score = score_map((*target, target_score), (*other, 0.5))
    return bool(flags(tracker, score, target)[cell(other)])


def test_three_frames_make_a_distractor():
    assert [excludes(learned(frames)) for frames in (1, 2, 3, 4)] == [False, False, True, True]


@pytest.mark.parametrize(
    ("target_score", "other_score", "excluded"),
    [
        (0.36, 0.2, True),
        (0.34, 0.2, False),  # the target's mean score is too low
        (0.6, 0.44, True),
        (0.6, 0.46, False),  # more than .75 of the target's
        (0.6, 0.11, True),
        (0.6, 0.09, False),  # not a peak
    ],
)
def test_scores_of_distractors(target_score, other_score, excluded):
    assert excludes(learned(5, target_score, other_score)) is excluded


def at(xy, distance, size=SIZE):
    """A point to the right, at a distance in target sizes; in the middle of a cell."""
    return xy[0] + distance * size, xy[1]


@pytest.mark.parametrize(("steps", "excluded"), [(3, True), (4, False)])
def test_a_distractor_moves_at_most_half_a_target_size(steps, excluded):
    """The cells are 8 px apart, the target's size is 60 px: 24 and 32 px."""
    moved = (DISTRACTOR[0] + 8 * steps, DISTRACTOR[1])
    assert excludes(learned(5), other=moved) is excluded


@pytest.mark.parametrize(("steps", "known"), [(3, True), (4, False)])
def test_a_distractor_that_moves_too_far_is_another_one(steps, known):
    tracker = learned(5)
    moved = (DISTRACTOR[0] + 8 * steps, DISTRACTOR[1])
    score = score_map((*TARGET, 0.6), (*moved, 0.3))
    tracker.update(tracker.detect(POSITIONS, score, state()), cell(TARGET))
    frames = sorted(each.frames for each in tracker._distractors)
    assert frames == ([6] if known else [1, 5])


@pytest.mark.parametrize(("steps", "excluded"), [(2, True), (3, False)])
def test_a_peak_near_the_target_is_needed(steps, excluded):
    """Within .4 target sizes, 24 px."""
    moved = (TARGET[0] - 8 * steps, TARGET[1])
    score = score_map((*moved, 0.6), (*DISTRACTOR, 0.5))
    assert bool(flags(learned(5), score, TARGET)[cell(DISTRACTOR)]) is excluded


def test_means_of_scores_move_by_a_fifth():
    tracker = learned(1, 0.6, 0.3)
    assert tracker._target_score == pytest.approx(0.6)
    score = score_map((*TARGET, 0.8), (*DISTRACTOR, 0.5))
    tracker.update(tracker.detect(POSITIONS, score, state()), cell(TARGET))
    assert tracker._target_score == pytest.approx(0.8 * 0.6 + 0.2 * 0.8)
    (distractor,) = tracker._distractors
    assert distractor.score == pytest.approx(0.8 * 0.3 + 0.2 * 0.5)
    assert distractor.frames == 2
    alone = score_map((*TARGET, 0.6))
    tracker.update(tracker.detect(POSITIONS, alone, state()), cell(TARGET))
    (hidden,) = tracker._distractors
    assert hidden.score == pytest.approx(0.8 * 0.34)
    assert hidden.frames == 2
    np.testing.assert_array_equal(hidden.xy, DISTRACTOR)


def test_a_hidden_distractor_is_forgotten_below_a_score_of_three_percent():
    tracker = learned(5, 0.6, 0.3)
    alone = score_map((*TARGET, 0.6))
    counts = []
    for _ in range(12):
        tracker.update(tracker.detect(POSITIONS, alone, state()), cell(TARGET))
        counts.append(len(tracker._distractors))
    assert counts.index(0) == 10  # .3 * .8 ** 11 < .03
    assert sorted(counts, reverse=True) == counts


def test_a_distractor_behind_the_target_is_forgotten():
    tracker = learned(5)
    here = score_map((*DISTRACTOR, 0.6))
    tracker.update(tracker.detect(POSITIONS, here, state(DISTRACTOR)), cell(DISTRACTOR))
    assert tracker._distractors == []


def test_at_most_six_peaks_one_for_each_object():
    objects = [(20.0 + 56 * n, y, 0.9 - 0.1 * n) for n, y in enumerate([20.0, 220, 20, 220])]
    objects += [(84.0, 124.0, 0.45), (140.0, 124.0, 0.4), (220.0, 124.0, 0.3)]
    found = DistractorTracker().detect(POSITIONS, score_map(*objects), state())
    assert found.peaks == [cell(each[:2]) for each in objects[:6]]
    assert found.target_size == SIZE
    near = score_map((*TARGET, 0.6), (TARGET[0] + 24, TARGET[1], 0.5))
    assert DistractorTracker().detect(POSITIONS, near, state()).peaks == [cell(TARGET)]
    beyond = score_map((*TARGET, 0.6), (TARGET[0] + 32, TARGET[1], 0.5))
    assert len(DistractorTracker().detect(POSITIONS, beyond, state()).peaks) == 2


def test_a_disabled_tracker_finds_nothing():
    tracker = DistractorTracker(enabled=False)
    for _ in range(5):
        found = tracker.detect(POSITIONS, score_map((*TARGET, 0.6), (*DISTRACTOR, 0.3)), state())
        tracker.update(found, cell(TARGET))
    assert tracker._distractors == []
    assert not found.is_distractor.any()
    assert found.target_size == SIZE


def test_peaks_of_several_anchors_are_found_once():
    low = score_map((*TARGET, 0.4))
    high = score_map((*TARGET, 0.6), (*DISTRACTOR, 0.3))
    positions = np.concatenate([POSITIONS, POSITIONS])
    found = DistractorTracker().detect(positions, np.concatenate([low, high]), state(), 2)
    assert found.peaks == [SIDE**2 + cell(TARGET), SIDE**2 + cell(DISTRACTOR)]


def test_scores_of_distractors_are_minus_one():
    tracker = learned(5)
    score = score_map((*TARGET, 0.6), (*DISTRACTOR, 0.5))
    found = tracker.detect(POSITIONS, score, state())
    np.testing.assert_array_equal(found.allowed_score, np.where(found.is_distractor, -1, score))
    distances = np.linalg.norm(POSITIONS - POSITIONS[cell(DISTRACTOR)], axis=1)
    expected = distances < 0.4 * SIZE
    np.testing.assert_array_equal(found.is_distractor, expected)


def test_sizes_are_the_geometric_mean_of_the_sides():
    wide = TargetState(TARGET, (90.0, 40.0))
    found = DistractorTracker().detect(POSITIONS, score_map((*TARGET, 0.6)), wide)
    assert found.target_size == pytest.approx(60)
    assert found.distances(np.array([[4.0, 3.0]]), np.array([4.0, 63.0]))[0] == pytest.approx(1)
