"""Loss and re-detection by the running score, and the boxes that an occluded target can have."""

import numpy as np
import pytest

import ssiam
from helpers.tracker_scenes import OPEN, filmed, shaking_pan, target_box
from ssiam.motion import Motion
from ssiam.trackers.lost import LossDetector, ReachableBox


def after(*scores):
    loss = LossDetector()
    for score in scores:
        loss.update(score)
    return loss


GOOD, BAD = [0.95] * 40, [0.0] * 40


def test_single_low_scores_do_not_lose_the_target():
    assert not after(0.0).lost
    assert not after(*GOOD, 0.0).lost
    loss = LossDetector()
    for _ in range(20):
        for score in (*GOOD, 0.0):
            loss.update(score)
            assert not loss.lost


def test_consecutive_low_scores_lose_the_target_and_are_counted():
    loss, lost, frames = LossDetector(), [], []
    for score in (*GOOD, *BAD):
        loss.update(score)
        lost.append(loss.lost)
        frames.append(loss.frames_lost)
    first = lost.index(True)
    assert first > len(GOOD)
    assert all(lost[first:])
    assert frames == [0] * first + list(range(len(lost) - first))


def test_redetection_takes_several_high_scores():
    assert after(*GOOD, *BAD, 0.95).lost
    found = after(*GOOD, *BAD, *GOOD)
    assert not found.lost
    assert found.frames_lost == 0
    lost_again = after(*GOOD, *BAD, *GOOD, *BAD)
    assert lost_again.lost
    assert lost_again.frames_lost < len(BAD)


def test_a_confirmed_target_is_redetected_at_once():
    loss = after(*GOOD, *BAD)
    loss.confirm()
    assert not loss.lost
    assert loss.frames_lost == 0
    loss.update(0.5)
    assert not loss.lost
    tracked = after(*GOOD)
    tracked.confirm()
    assert tracked._running == after(*GOOD)._running


def test_hysteresis():
    """There are scores that neither lose a tracked target nor re-detect a lost one."""
    between = [
        score
        for score in np.linspace(0, 1, 101)
        if not after(*[score] * 200).lost and after(*BAD, *[score] * 200).lost
    ]
    assert len(between) > 10
    assert np.ptp(between) == pytest.approx((len(between) - 1) / 100)


SIZE = (640, 480)
BOX = (100.0, 80.0, 40.0, 40.0)
STILL = Motion.none(SIZE, reliable=True)
PAN = Motion.from_transform([[1, 0, 10], [0, 1, 0]], SIZE)


def unseen(*motions):
    """The reachable box of a target last seen in BOX, after frames reached by these motions."""
    reachable = ReachableBox(BOX)
    for motion in motions:
        reachable.advance(motion)
    return reachable


def shifted(sizes, scale=1.0):
    """BOX moved to the right by a number of its sizes, and scaled about its center."""
    x, y, w, h = BOX
    return x + sizes * w + (1 - scale) * w / 2, y + (1 - scale) * h / 2, scale * w, scale * h


def test_a_visible_target_can_have_any_box():
    assert unseen(STILL).contains(shifted(3, scale=2))


def test_a_hidden_target_keeps_its_position_and_size():
    reachable = unseen(STILL, STILL)
    assert reachable.contains(BOX)
    assert reachable.contains(shifted(0.6, scale=1.1))
    assert not reachable.contains(shifted(1))
    assert not reachable.contains(shifted(-1))
    assert not reachable.contains(shifted(0, scale=1.5))
    assert not reachable.contains(shifted(0, scale=1 / 1.5))


def test_the_reach_grows_with_the_number_of_frames():
    for sizes in (1, 1.5):
        found = [unseen(*[STILL] * frames).contains(shifted(sizes)) for frames in range(2, 100)]
        assert found == sorted(found)
        assert 10 < found.index(True) < 80


def test_positions_in_the_scene_and_in_the_frame_are_reachable():
    reachable = unseen(*[PAN] * 10)  # by 2.5 target sizes
    assert reachable.contains(shifted(2.5))
    assert reachable.contains(shifted(0))
    assert not reachable.contains(shifted(1.25))
    assert not reachable.contains(shifted(-2.5))


def test_after_a_cut_the_position_in_the_frame_is_reachable():
    reachable = unseen(STILL, *[Motion.none(SIZE)] * 10)
    assert reachable.contains(BOX)
    assert not reachable.contains(shifted(2))


def test_only_a_reachable_observation_is_taken():
    reachable = unseen(*[STILL] * 10)
    reachable.observe(shifted(2))  # another object
    reachable.advance(STILL)
    assert not reachable.contains(shifted(2))
    reachable.observe(shifted(0.5))
    for _ in range(2):
        reachable.advance(STILL)
    assert reachable.contains(shifted(1))
    assert not reachable.contains(shifted(-0.5))


@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
def test_a_target_is_lost_after_ten_blank_frames_with_any_method(stabilize):
    pose = shaking_pan(1)[0]
    frame = filmed(OPEN, pose)
    tracker = ssiam.load_tracker("kcf", stabilize=stabilize)
    tracker.init(frame, target_box(pose))
    assert not tracker.update(frame).lost
    tracks = [tracker.update(np.zeros_like(frame)) for _ in range(10)]
    assert tracks[-1].lost
    assert tracks[-1].score == 0


def test_the_fourth_score_of_zero_loses_the_target():
    loss = LossDetector()
    lost = []
    for _ in range(4):
        loss.update(0.0)
        lost.append(loss.lost)
    assert lost == [False, False, False, True]


def test_redetection_needs_more_than_the_threshold():
    loss = after(*[0.0] * 100)
    loss.update(1.0)  # the running score is the threshold now
    assert loss.lost
    assert loss.frames_lost == 97
    loss.update(1.0)
    assert (loss.lost, loss.frames_lost) == (False, 0)


@pytest.mark.parametrize(("score", "frames"), [(1.0, 3), (0.65, 6), (0.5, 26), (0.4, 51)])
def test_after_blank_frames_redetection_needs_higher_scores_at_first(score, frames):
    """The threshold falls from .6 to .35 by .004 per frame."""
    loss = LossDetector()
    for _ in range(50):
        loss.skip_blank()
    found = []
    for _ in range(60):
        loss.update(score)
        found.append(not loss.lost)
    assert found.index(True) + 1 == frames


def test_three_blank_frames_lose_the_target():
    loss = LossDetector()
    lost = []
    for _ in range(3):
        loss.skip_blank()
        lost.append(loss.lost)
    assert lost == [False, False, True]
    assert loss.frames_lost == 0


def test_a_blank_frame_of_a_lost_target_does_not_count():
    loss = after(*BAD)
    count = loss.frames_lost
    loss.skip_blank()
    assert (loss.lost, loss.frames_lost) == (True, count)


WIDE = (100.0, 80.0, 80.0, 20.0)  # size 40


@pytest.mark.parametrize(
    ("xywh", "reachable"),
    [
        ((129.1, 80, 80, 20), True),  # .73 sizes after two frames
        ((129.3, 80, 80, 20), False),
        ((100, 109.1, 80, 20), True),
        ((100, 109.3, 80, 20), False),
        ((70.9, 80, 80, 20), True),
        ((70.7, 80, 80, 20), False),
        ((120, 70, 40, 40), True),  # another shape of the same area
        ((100 - 7, 80 - 1.75, 94, 23.5), True),  # larger by 2 ** (.73 / 3) = 1.184
        ((100 - 8, 80 - 2, 96, 24), False),
        ((100 + 6, 80 + 1.5, 68, 17), True),
        ((100 + 7, 80 + 1.75, 66, 16.5), False),
        ((129.1 - 7, 80 - 1.75, 94, 23.5), True),  # the larger difference counts, not the sum
    ],
)
def test_the_reach_in_target_sizes(xywh, reachable):
    target = ReachableBox(WIDE)
    for _ in range(2):
        target.advance(STILL)
    assert target.contains(xywh) is reachable


def test_one_frame_without_the_target_leaves_any_box_reachable():
    target = ReachableBox(WIDE)
    target.advance(STILL)
    assert target.contains((500, 300, 9, 9))
    target.advance(STILL)
    assert not target.contains((500, 300, 9, 9))
    target.observe(WIDE)
    target.advance(STILL)
    assert target.contains((500, 300, 9, 9))
