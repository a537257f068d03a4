"""The loop of `lite`'s second network on networks that see a marker, and its memory."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.stub_networks import Stub, marked
from helpers.tracker_loops import BOX, LoopTests, moving
from ssiam import FrameView
from ssiam.trackers.lite2 import Lite2Networks, Lite2Tracker, Memory


def seeing_search(elsewhere=0.0):
    """Search network whose cells know how far the marker's sides are; `elsewhere`: in a corner."""

    def answer(t, crop, *kernels):
        score = np.full((1, 1, 15, 15), -8, np.float32)
        quality = np.full((1, 1, 15, 15), 8, np.float32)
        distances = np.full((1, 4, 15, 15), 8, np.float32)
        rows, columns = np.nonzero(marked(crop[0]))
        if len(rows):
            at = (np.arange(15) - 7) * 16
            y, x = np.meshgrid(at, at, indexing="ij")
            left, right = columns.min() - 127.5, columns.max() - 126.5
            top, bottom = rows.min() - 127.5, rows.max() - 126.5
            distances[0] = x - left, y - top, right - x, bottom - y
            apart = np.hypot(x - (left + right) / 2, y - (top + bottom) / 2)
            score[0, 0][apart < 17] = 8
        if elsewhere:
            score[0, 0, 0, 0] = np.log(elsewhere / (1 - elsewhere))
            distances[0, :, 0, 0] = 8
        return [score, quality, distances]

    return Stub(answer)


def networks(**options):
    """The context of a template is its number."""

    def template(t, crop):
        return [crop, np.full((1, 1), t, np.float32)]

    return Lite2Networks(Stub(template), seeing_search(**options))


class TestLite2(LoopTests):
    def tracker(self):
        return Lite2Tracker(networks())


def recent(tracker, frames):
    """Number of the template that was recent at each frame."""
    tracker.init(FrameView(frames[0]), BOX)
    for frame in frames[1:]:
        tracker.track(FrameView(frame))
    return [int(inputs[-1].item()) for inputs in tracker._networks.search.given]


FRAMES = [moving(BOX)[0][0]] * 12


def test_the_recent_template_is_taken_anew():
    tracker = Lite2Tracker(networks(), memory=Memory(every=4))
    assert recent(tracker, FRAMES) == [1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3]


@pytest.mark.parametrize(
    ("memory", "elsewhere"),
    [
        pytest.param(Memory(every=0), 0.0, id="never"),
        pytest.param(Memory(every=4, score=1.0), 0.0, id="unsure"),
        pytest.param(Memory(every=4), 0.6, id="a distractor"),
    ],
)
def test_it_stays_the_first(memory, elsewhere):
    tracker = Lite2Tracker(networks(elsewhere=elsewhere), memory=memory)
    assert set(recent(tracker, FRAMES)) == {1}


def test_it_is_dropped_when_the_target_is_looked_for_elsewhere():
    tracker = Lite2Tracker(networks(), memory=Memory(every=4))
    recent(tracker, FRAMES)
    tracker.seek(FrameView(FRAMES[0]), BOX)
    assert int(tracker._networks.search.given[-1][-1].item()) == 1


def test_another_has_no_target_of_its_own():
    tracker = Lite2Tracker(networks(), memory=replace(Memory(), every=4))
    assert tracker.clone()._memory == tracker._memory
