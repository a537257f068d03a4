"""Protocols: restarts, one pass and real time, with scripted trackers."""

import numpy as np
import pytest

from ssiam.datasets import VideoSequence
from ssiam.errors import SourceError
from ssiam.evaluation.measures.trajectory import Status
from ssiam.evaluation.runs.protocols import RealtimeTracker, run
from ssiam.track import Track

SIZE = (60, 80, 3)
TARGET = (20.0, 10.0, 12.0, 8.0)
AWAY = (60.0, 45.0, 12.0, 8.0)
S, B, F, T = Status.SKIPPED, Status.INITIALIZED, Status.FAILED, Status.TRACKED


class Scripted:
    """Returns AWAY in given frames, else the target's box."""

    def __init__(self, away=(), corners=None):
        self._away, self._corners = set(away), corners
        self.started = []

    def init(self, frame, box):
        self.started.append((int(frame[0, 0, 0]), tuple(box)))

    def update(self, frame):
        box = AWAY if int(frame[0, 0, 0]) in self._away else TARGET
        return Track(box, corners=self._corners)


class Numbered(VideoSequence):
    """A sequence whose frames have their index in the first pixel."""

    def images(self, start=0):
        for number in range(start, len(self)):
            image = np.zeros(SIZE, np.uint8)
            image[0, 0] = number
            yield image


def sequence(count=20, unknown=(), frames=None):
    truth = np.tile(TARGET, (count, 1))
    truth[list(unknown)] = np.nan
    return Numbered("numbers", tuple(range(frames or count)), truth)


def test_restart_five_frames_after_a_failure():
    tracker = Scripted(away=[4, 16])
    found = run(tracker, sequence())
    expected = [B, T, T, T, F, S, S, S, S, B, T, T, T, T, T, T, F, S, S, S]
    assert found.status.tolist() == expected
    assert [start for start, _ in tracker.started] == [0, 9]
    assert tracker.started[1][1] == TARGET
    assert np.isnan(found.regions[found.status != T]).all()
    np.testing.assert_array_equal(found.regions[found.status == T][0], TARGET)


@pytest.mark.parametrize("protocol", ["vot", "realtime"])
def test_trackers_start_on_the_corners_of_a_polygon(protocol):
    """How a polygon becomes a box depends on the tracker."""
    polygon = (20.0, 11.0, 31.0, 10.0, 32.0, 17.0, 21.0, 18.0)
    tracker = Scripted()
    run(tracker, Numbered("numbers", tuple(range(3)), np.tile(polygon, (3, 1))), protocol)
    assert tracker.started == [(0, polygon)]


def test_one_pass_continues_after_a_loss():
    found = run(Scripted(away=[4, 5]), sequence(), "ope")
    assert found.status.tolist() == [B] + [T] * 19
    np.testing.assert_array_equal(found.regions[4], AWAY)


def test_frames_without_ground_truth_neither_fail_nor_start():
    tracker = Scripted(away=[3, 6, 7])
    found = run(tracker, sequence(14, unknown=[0, 6, 12]))
    assert found.status.tolist() == [S, B, T, F, S, S, S, S, B, T, T, T, T, T]
    found = run(Scripted(away=[6]), sequence(8, unknown=[6]))
    assert found.status.tolist() == [B, T, T, T, T, T, T, T]


def test_rotated_boxes_are_stored_as_corners():
    corners = np.array([[20, 10], [32, 10], [32, 18], [20, 18.0]])
    found = run(Scripted(corners=corners), sequence(3))
    np.testing.assert_array_equal(found.regions[1], corners.ravel())


def test_missing_frames_are_an_error():
    class Short(Numbered):
        def images(self, start=0):
            yield from list(super().images(start))[:3]

    with pytest.raises(SourceError, match="numbers: ends after 3 of 5 frames"):
        run(Scripted(), Short("numbers", tuple(range(5)), np.tile(TARGET, (5, 1))))


def test_unknown_protocol():
    with pytest.raises(ValueError, match=r"unknown protocol 'magic'.*realtime"):
        run(Scripted(), sequence(), "magic")


class Slow:
    """Takes given seconds for each call, on its own simulated clock."""

    def __init__(self, seconds):
        self.now = 0.0
        self._seconds = list(seconds)
        self.updates = 0

    def clock(self):
        return self.now

    def init(self, frame, box):
        self.now += self._seconds.pop(0)

    def update(self, frame):
        self.now += self._seconds.pop(0)
        self.updates += 1
        return Track((float(self.updates), 0.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("seconds", "expected"),
    {
        "in time": ([0.02] * 5, [1, 2, 3, 4]),
        "slow within the grace period": ([0.2, 0.2, 0.2, 0.02, 0.02], [1, 2, 3, 4]),
        "one slow frame delays the next ones": ([0.01] * 3 + [0.18] + [0.01] * 9, [1, 2, 3, 4, 5]),
        "grace used up": ([0.06, 0.06, 0.06, 0.16, 0.01], [1, 2, 3, 3, 3, 4]),
    }.values(),
)
def test_late_frames_repeat_the_last_result(seconds, expected):
    tracker = Slow(seconds)
    realtime = RealtimeTracker(tracker, fps=20.0, grace=3, clock=tracker.clock)
    realtime.init(None, (0.0, 0.0, 1.0, 1.0))
    assert [realtime.update(None).box[0] for _ in expected] == expected


def test_a_tracker_at_half_the_rate_misses_every_other_frame():
    tracker = Slow([0.1] * 40)
    realtime = RealtimeTracker(tracker, fps=20.0, grace=0, clock=tracker.clock)
    realtime.init(None, (0.0, 0.0, 1.0, 1.0))
    for _ in range(40):
        realtime.update(None)
    assert 18 <= tracker.updates <= 22


def test_a_fast_tracker_has_the_same_realtime_and_supervised_runs():
    supervised, realtime = (
        run(Scripted(away=[4]), sequence(), name) for name in ("vot", "realtime")
    )
    np.testing.assert_array_equal(supervised.status, realtime.status)
    np.testing.assert_array_equal(supervised.regions, realtime.regions)
