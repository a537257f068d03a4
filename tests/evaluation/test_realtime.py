"""The realtime protocol: 20 frames a second, and three late frames after each start are free."""

import numpy as np
import pytest

from ssiam.datasets import VideoSequence
from ssiam.evaluation.runs import protocols
from ssiam.evaluation.runs.protocols import RealtimeTracker, run
from ssiam.track import Track

COUNT = 12


class Timed:
    """A tracker whose calls take given times, in seconds, on its own clock."""

    def __init__(self, seconds):
        self.now = 0.0
        self._seconds = iter(seconds)
        self.tracked_frames = []
        self._box = None

    def clock(self):
        return self.now

    def init(self, frame, box):
        self.now += next(self._seconds)
        self._box = box

    def update(self, frame):
        self.now += next(self._seconds)
        self.tracked_frames.append(int(frame[0, 0, 0]))
        return Track(self._box)


class Numbered(VideoSequence):
    """A sequence whose frames have their index as pixel values."""

    def images(self, start=0):
        for index in range(start, len(self)):
            yield np.full((60, 80, 3), index, np.uint8)


def tracked_frames(monkeypatch, seconds):
    """Indices of the frames that `run` passed to the tracker, without the first one."""
    tracker = Timed(seconds)
    monkeypatch.setattr(
        protocols,
        "RealtimeTracker",
        lambda inner, fps, grace: RealtimeTracker(inner, fps, grace, tracker.clock),
    )
    truth = np.tile((20.0, 10.0, 12.0, 8.0), (COUNT, 1))
    run(tracker, Numbered("numbers", tuple(range(COUNT)), truth), "realtime")
    return tracker.tracked_frames


@pytest.mark.parametrize(
    ("milliseconds", "missed"),
    [pytest.param(49, [], id="in time"), pytest.param(62, [9], id="late")],
)
def test_a_frame_lasts_50_milliseconds(monkeypatch, milliseconds, missed):
    """After three free frames, a delay of 12 ms per frame exceeds 50 ms after five frames."""
    frames = tracked_frames(monkeypatch, [0.0] + COUNT * [milliseconds / 1000])
    assert sorted(set(range(1, COUNT)) - set(frames)) == missed


@pytest.mark.parametrize(
    ("late_frames", "missed"),
    [pytest.param(3, [], id="three"), pytest.param(4, [5, 6], id="four")],
)
def test_three_late_frames_after_a_start_are_free(monkeypatch, late_frames, missed):
    """A fourth one of 160 ms is 110 ms late, so that two frames are missed."""
    seconds = [0.0] + late_frames * [0.16] + COUNT * [0.01]
    frames = tracked_frames(monkeypatch, seconds)
    assert sorted(set(range(1, COUNT)) - set(frames)) == missed
