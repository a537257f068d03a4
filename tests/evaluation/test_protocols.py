"""Restarts, one pass, and the clock, with trackers whose answers are written down."""

import numpy as np
import pytest

from ssiam.datasets import VideoSequence
from ssiam.errors import SourceError
from ssiam.evaluation.protocols import Clocked, run
from ssiam.evaluation.trajectory import Status
from ssiam.track import Track

SIZE = (60, 80, 3)
TARGET = (20.0, 10.0, 12.0, 8.0)
AWAY = (60.0, 45.0, 12.0, 8.0)
S, B, F, T = Status.SKIPPED, Status.INITIALIZED, Status.FAILED, Status.TRACKED


class Scripted:
    """Answers AWAY in the frames that are told, else the target's place."""

    def __init__(self, away=(), corners=None):
        self._away, self._corners = set(away), corners
        self.started = []

    def init(self, frame, box):
        self.started.append((int(frame[0, 0, 0]), tuple(box)))

    def update(self, frame):
        box = AWAY if int(frame[0, 0, 0]) in self._away else TARGET
        return Track(box, corners=self._corners)


class Numbered(VideoSequence):
    """A sequence whose frames carry their number in their first pixel."""

    def images(self, start=0):
        for number in range(start, len(self)):
            image = np.zeros(SIZE, np.uint8)
            image[0, 0] = number
            yield image


def sequence(count=20, unknown=(), frames=None):
    truth = np.tile(TARGET, (count, 1))
    truth[list(unknown)] = np.nan
    return Numbered("numbers", tuple(range(frames or count)), truth)


def test_a_failure_is_skipped_and_started_again_five_frames_later():
    tracker = Scripted(away=[4, 16])
    found = run(tracker, sequence())
    expected = [B, T, T, T, F, S, S, S, S, B, T, T, T, T, T, T, F, S, S, S]
    assert found.status.tolist() == expected
    assert [start for start, _ in tracker.started] == [0, 9]
    assert tracker.started[1][1] == TARGET
    assert np.isnan(found.regions[found.status != T]).all()
    np.testing.assert_array_equal(found.regions[found.status == T][0], TARGET)


def test_one_pass_goes_on_where_the_target_is_lost():
    found = run(Scripted(away=[4, 5]), sequence(), "ope")
    assert found.status.tolist() == [B] + [T] * 19
    np.testing.assert_array_equal(found.regions[4], AWAY)


def test_frames_without_truth_neither_fail_nor_start():
    tracker = Scripted(away=[3, 6, 7])
    found = run(tracker, sequence(14, unknown=[0, 6, 12]))
    assert found.status.tolist() == [S, B, T, F, S, S, S, S, B, T, T, T, T, T]
    found = run(Scripted(away=[6]), sequence(8, unknown=[6]))
    assert found.status.tolist() == [B, T, T, T, T, T, T, T]


def test_rotated_boxes_are_kept_as_they_are():
    corners = np.array([[20, 10], [32, 10], [32, 18], [20, 18.0]])
    found = run(Scripted(corners=corners), sequence(3))
    np.testing.assert_array_equal(found.regions[1], corners.ravel())


def test_missing_frames_are_told():
    class Short(Numbered):
        def images(self, start=0):
            yield from list(super().images(start))[:3]

    with pytest.raises(SourceError, match="numbers: ends after 3 of 5 frames"):
        run(Scripted(), Short("numbers", tuple(range(5)), np.tile(TARGET, (5, 1))))


def test_unknown_protocols_are_named():
    with pytest.raises(ValueError, match=r"unknown protocol 'magic'.*realtime"):
        run(Scripted(), sequence(), "magic")


class Slow:
    """Takes a written number of seconds for each call, on a clock of its own."""

    def __init__(self, took):
        self.now = 0.0
        self._took = list(took)
        self.answered = 0

    def clock(self):
        return self.now

    def init(self, frame, box):
        self.now += self._took.pop(0)

    def update(self, frame):
        self.now += self._took.pop(0)
        self.answered += 1
        return Track((float(self.answered), 0.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("took", "expected"),
    {
        "in time": ([0.02] * 5, [1, 2, 3, 4]),
        "slow while there is grace": ([0.2, 0.2, 0.2, 0.02, 0.02], [1, 2, 3, 4]),
        "one slow frame costs the next ones": ([0.01] * 3 + [0.18] + [0.01] * 9, [1, 2, 3, 4, 5]),
        "grace used up": ([0.06, 0.06, 0.06, 0.16, 0.01], [1, 2, 3, 3, 3, 4]),
    }.values(),
)
def test_the_clock_drops_frames(took, expected):
    tracker = Slow(took)
    clocked = Clocked(tracker, fps=20.0, grace=3, clock=tracker.clock)
    clocked.init(None, (0.0, 0.0, 1.0, 1.0))
    assert [clocked.update(None).box[0] for _ in expected] == expected


def test_a_tracker_that_is_always_late_misses_every_other_frame():
    tracker = Slow([0.1] * 40)
    clocked = Clocked(tracker, fps=20.0, grace=0, clock=tracker.clock)
    clocked.init(None, (0.0, 0.0, 1.0, 1.0))
    for _ in range(40):
        clocked.update(None)
    assert 18 <= tracker.answered <= 22


def test_the_realtime_run_is_the_supervised_one_for_a_quick_tracker():
    calm, clocked = (run(Scripted(away=[4]), sequence(), name) for name in ("vot", "realtime"))
    np.testing.assert_array_equal(calm.status, clocked.status)
    np.testing.assert_array_equal(calm.regions, clocked.regions)
