import numpy as np
import pytest

from ssiam.trackers.watch import Watch


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
