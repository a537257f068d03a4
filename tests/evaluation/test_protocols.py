"""Protocols: restarts, one pass and real time, with scripted trackers."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from ssiam.datasets import VideoSequence
from ssiam.errors import SourceError
from ssiam.evaluation.measures.trajectory import Status
from ssiam.evaluation.runs import protocols
from ssiam.evaluation.runs.protocols import RealtimeTracker, run
from ssiam.geometry import area_preserving_xywh
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


def test_the_slow_frames_that_a_start_may_have_are_counted_anew_at_each_start():
    tracker = Slow([0.02, 0.12, 0.12, 0.02, 0.12, 0.02])
    realtime = RealtimeTracker(tracker, fps=20.0, grace=1, clock=tracker.clock)
    realtime.init(None, (0.0, 0.0, 1.0, 1.0))
    assert [realtime.update(None).box[0] for _ in range(3)] == [1, 2, 2]
    realtime.init(None, (0.0, 0.0, 1.0, 1.0))
    assert [realtime.update(None).box[0] for _ in range(2)] == [3, 4]


def test_a_start_that_takes_long_repeats_the_given_box():
    tracker = Slow([0.16, 0.01])
    realtime = RealtimeTracker(tracker, fps=20.0, grace=0, clock=tracker.clock)
    realtime.init(None, (3.0, 4.0, 5.0, 6.0))
    found = [realtime.update(None).box for _ in range(3)]
    assert found == [(3, 4, 5, 6), (3, 4, 5, 6), (1, 0, 1, 1)]


def test_a_start_on_a_polygon_repeats_the_box_of_the_same_area():
    tracker = Slow([0.16])
    realtime = RealtimeTracker(tracker, fps=20.0, grace=0, clock=tracker.clock)
    diamond = (20.0, 10.0, 30.0, 20.0, 20.0, 30.0, 10.0, 20.0)
    realtime.init(None, diamond)
    assert realtime.update(None).box == pytest.approx(area_preserving_xywh(diamond))


class OnItsClock(Scripted):
    """Takes `start` seconds to start and `each` seconds for a frame."""

    def __init__(self, start, each, **how):
        super().__init__(**how)
        self._start, self._each, self.now, self.updated = start, each, 100.0, []

    def clock(self):
        return self.now

    def init(self, frame, box):
        self.now += self._start
        super().init(frame, box)

    def update(self, frame):
        self.now += self._each
        self.updated.append(int(frame[0, 0, 0]))
        return super().update(frame)


def test_the_time_of_each_call_is_measured(monkeypatch):
    tracker = OnItsClock(2.0, 0.5, away=[3])
    monkeypatch.setattr(protocols, "time", SimpleNamespace(perf_counter=tracker.clock))
    found = run(tracker, sequence(10, unknown=[0]))
    assert found.seconds.tolist() == [0, 2, 0.5, 0.5, 0, 0, 0, 0, 2, 0.5]


def test_real_time_is_20_frames_per_second_after_three_slow_ones(monkeypatch):
    tracker = OnItsClock(0.12, 0.12)
    real_time = partial(RealtimeTracker, clock=tracker.clock)
    monkeypatch.setattr(protocols, "RealtimeTracker", real_time)
    found = run(tracker, sequence(12), "realtime")
    # The start and two frames may be slow. Each other one is 70 ms late, and a missed frame makes
    # up for 50 ms.
    assert tracker.updated == [1, 2, 3, 5, 7, 10]
    assert found.status.tolist() == [B] + [T] * 11


class Listed(Scripted):
    """Returns the given results, one for each frame after the first."""

    def __init__(self, *tracks):
        super().__init__()
        self._tracks = list(tracks)

    def update(self, frame):
        return self._tracks.pop(0)


NOWHERE = Track((np.nan,) * 4)


def test_a_result_without_a_box_is_a_loss():
    found = run(Listed(Track(TARGET), NOWHERE), sequence(3))
    assert found.status.tolist() == [B, T, F]


@pytest.mark.parametrize("protocol", ["vot", "ope"])
def test_a_result_without_a_box_is_skipped_if_it_is_no_loss(protocol):
    found = run(Listed(NOWHERE, Track(TARGET)), sequence(3, unknown=[1]), protocol)
    assert found.status.tolist() == [B, S, T]
    found = run(Listed(NOWHERE, Track(TARGET)), sequence(3), "ope")
    assert found.status.tolist() == [B, S, T]


def test_boxes_and_corners_in_one_run():
    corners = np.array([[20, 10], [32, 10], [32, 18], [20, 18.0]])
    found = run(Listed(Track(TARGET), Track(TARGET, corners=corners)), sequence(3))
    assert found.regions.shape == (3, 8)
    np.testing.assert_array_equal(found.regions[1], [*TARGET, *[np.nan] * 4])
    np.testing.assert_array_equal(found.regions[2], corners.ravel())
    assert run(Scripted(), sequence(3)).regions.shape == (3, 4)


def test_overlap_outside_of_the_frame_does_not_count():
    """Frames are 80 pixels wide and 60 high."""

    def statuses(truth, found):
        frames = tuple(range(2))
        return run(
            Listed(Track(found)), Numbered("numbers", frames, np.tile(truth, (2, 1)))
        ).status.tolist()

    assert statuses((70.0, 10.0, 20.0, 8.0), (82.0, 10.0, 8.0, 8.0)) == [B, F]
    assert statuses((70.0, 10.0, 20.0, 8.0), (72.0, 10.0, 8.0, 8.0)) == [B, T]
    assert statuses((10.0, 50.0, 8.0, 20.0), (10.0, 62.0, 8.0, 8.0)) == [B, F]
    assert statuses((10.0, 50.0, 8.0, 20.0), (10.0, 52.0, 8.0, 8.0)) == [B, T]


def test_frames_after_the_end_of_the_ground_truth_are_tracked():
    truth = np.tile(TARGET, (2, 1))
    found = run(Scripted(away=[3, 4]), Numbered("numbers", tuple(range(6)), truth))
    assert found.status.tolist() == [B, T, T, T, T, T]
    found = run(Scripted(away=[1]), Numbered("numbers", tuple(range(9)), truth))
    assert found.status.tolist() == [B, F] + [S] * 7


def test_each_protocol_has_a_folder_of_vot():
    assert protocols.EXPERIMENTS == {
        "vot": "baseline",
        "ope": "unsupervised",
        "realtime": "realtime",
    }
    assert protocols.PROTOCOLS == ("vot", "ope", "realtime")
