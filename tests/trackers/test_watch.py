import numpy as np
import pytest

from ssiam.motion import Motion
from ssiam.trackers.watch import Watch, Whereabouts


def watched(*scores):
    watch = Watch()
    for score in scores:
        watch.update(score)
    return watch


GOOD, BAD = [0.95] * 40, [0.0] * 40


def test_one_bad_frame_loses_nothing():
    assert not watched(0.0).lost
    assert not watched(*GOOD, 0.0).lost
    watch = Watch()
    for _ in range(20):  # nor do many, each on its own
        for score in (*GOOD, 0.0):
            watch.update(score)
            assert not watch.lost


def test_bad_frames_in_a_row_lose_the_target_and_are_counted():
    watch, lost, frames = Watch(), [], []
    for score in (*GOOD, *BAD):
        watch.update(score)
        lost.append(watch.lost)
        frames.append(watch.frames)
    first = lost.index(True)
    assert first > len(GOOD)
    assert all(lost[first:])
    assert frames == [0] * first + list(range(len(lost) - first))


def test_it_is_found_by_several_good_frames_not_by_one():
    assert watched(*GOOD, *BAD, 0.95).lost
    found = watched(*GOOD, *BAD, *GOOD)
    assert not found.lost
    assert found.frames == 0
    again = watched(*GOOD, *BAD, *GOOD, *BAD)  # and may be lost again
    assert again.lost
    assert again.frames < len(BAD)


def test_doubtful_scores_leave_what_is_known_as_it_is():
    """Hysteresis: there are scores that neither lose a target nor find it."""
    doubtful = [
        score
        for score in np.linspace(0, 1, 101)
        if not watched(*[score] * 200).lost and watched(*BAD, *[score] * 200).lost
    ]
    assert len(doubtful) > 10
    assert np.ptp(doubtful) == pytest.approx((len(doubtful) - 1) / 100)


SIZE = (640, 480)
BOX = (100.0, 80.0, 40.0, 40.0)
STILL = Motion.none(SIZE, reliable=True)
PAN = Motion.from_transform([[1, 0, 10], [0, 1, 0]], SIZE)


def unseen(*motions):
    """Of a target that was in BOX, and was not seen in the frames that these motions reached."""
    whereabouts = Whereabouts(BOX)
    for motion in motions:
        whereabouts.carry(motion)
    return whereabouts


def aside(sizes, grown=1.0):
    """BOX moved to the right by some of its sizes, and larger by a factor around its middle."""
    x, y, w, h = BOX
    return x + sizes * w + (1 - grown) * w / 2, y + (1 - grown) * h / 2, grown * w, grown * h


def test_a_target_that_was_seen_a_frame_ago_can_be_anywhere():
    assert unseen(STILL).explains(aside(3, grown=2))


def test_a_target_that_was_hidden_is_where_it_was_and_as_large():
    whereabouts = unseen(STILL, STILL)
    assert whereabouts.explains(BOX)
    assert whereabouts.explains(aside(0.6, grown=1.1))
    assert not whereabouts.explains(aside(1))
    assert not whereabouts.explains(aside(-1))
    assert not whereabouts.explains(aside(0, grown=1.5))
    assert not whereabouts.explains(aside(0, grown=1 / 1.5))


def test_the_longer_it_is_hidden_the_farther_it_can_get():
    for sizes in (1, 1.5):
        waits = [unseen(*[STILL] * frames).explains(aside(sizes)) for frames in range(2, 100)]
        assert waits == sorted(waits)
        assert 10 < waits.index(True) < 80


def test_it_is_where_it_was_in_the_scene_or_in_the_picture():
    whereabouts = unseen(*[PAN] * 10)  # by 2.5 of its sizes
    assert whereabouts.explains(aside(2.5))
    assert whereabouts.explains(aside(0))
    assert not whereabouts.explains(aside(1.25))
    assert not whereabouts.explains(aside(-2.5))


def test_after_a_cut_the_place_in_the_picture_counts():
    whereabouts = unseen(STILL, *[Motion.none(SIZE)] * 10)
    assert whereabouts.explains(BOX)
    assert not whereabouts.explains(aside(2))


def test_what_is_seen_where_it_can_be_is_its_place_from_then_on():
    whereabouts = unseen(*[STILL] * 10)
    whereabouts.see(aside(2))  # not it
    whereabouts.carry(STILL)
    assert not whereabouts.explains(aside(2))
    whereabouts.see(aside(0.5))
    for _ in range(2):
        whereabouts.carry(STILL)
    assert whereabouts.explains(aside(1))
    assert not whereabouts.explains(aside(-0.5))
