"""Positions at which a lost target is searched after the tracker has drifted away."""

import numpy as np
import pytest

import ssiam
from helpers.tracker_scenes import (
    COVERED,
    OPEN,
    OTHER_SCENE,
    ScriptedTracker,
    distance,
    filmed,
    shaking_pan,
    target_box,
)
from ssiam.geometry import rigid
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker

COUNT, HIDDEN = 130, range(20, 80)
PAN = (-110.0, 70.0)  # px, of the camera while the target is hidden
FOUND_BY = HIDDEN[-1] + 35  # a search has tried all its positions several times


class DriftingTracker(ScriptedTracker):
    """Without the target it drifts by 6 pixels per frame."""

    reach = 0.7

    def position_without_target(self):
        x, y, w, h = self._xywh
        return x + 6, y - 3, w, h

    def result(self, score):
        return Track(self._xywh, score)


def panned(path, shares):
    """The poses, each panned by a share of `PAN`."""
    return [
        rigid(share * PAN[0], share * PAN[1], 0) @ pose
        for pose, share in zip(path, shares, strict=True)
    ]


def hidden_by_a_cover():
    """A cover hides the target while the camera pans away and stays there."""
    shares = np.interp(np.arange(COUNT), [HIDDEN[0], HIDDEN[-1]], [0, 1])
    path = panned(shaking_pan(COUNT), shares)
    return [filmed(COVERED if t in HIDDEN else OPEN, pose) for t, pose in enumerate(path)], path


def hidden_by_a_cut():
    """A pan, a cut to another scene with a pan back and beyond, and a cut back to the first."""
    frames = np.arange(COUNT)
    before = np.interp(frames, [0, HIDDEN[0] - 1], [0, -0.6])
    during = np.interp(frames, [HIDDEN[0], HIDDEN[-1]], [-0.6, 1])
    shares = np.where((frames >= HIDDEN[0]) & (frames <= HIDDEN[-1]), during, before)
    path = panned(shaking_pan(COUNT), shares)
    return [filmed(OTHER_SCENE if t in HIDDEN else OPEN, pose) for t, pose in enumerate(path)], path


@pytest.mark.parametrize(
    "hidden",
    [
        pytest.param(hidden_by_a_cover, id="position in the scene"),
        pytest.param(hidden_by_a_cut, id="position before the cut"),
    ],
)
def test_a_lost_target_is_re_detected(hidden):
    frames, path = hidden()
    truth = [target_box(pose) for pose in path]
    visible = [None if t in HIDDEN else box for t, box in enumerate(truth)]
    tracker = StabilizedTracker(DriftingTracker(frames, visible), ssiam.StabilizerConfig())
    tracker.init(frames[0], truth[0])
    tracks = [None, *(tracker.update(frame) for frame in frames[1:])]
    assert tracks[HIDDEN[-1]].lost
    for t in range(FOUND_BY, COUNT):
        assert not tracks[t].lost
        assert distance(tracks[t].box, truth[t]) < 0.5
