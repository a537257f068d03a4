"""Positions at which a lost target is searched after the tracker has drifted away."""

import numpy as np
import pytest

import ssiam
from helpers.tracker_scenes import (
    COVERED,
    OPEN,
    OTHER_SCENE,
    distance,
    filmed,
    shaking_pan,
    target_box,
)
from ssiam.geometry import map_box, rigid
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker

COUNT, HIDDEN = 130, range(20, 80)
PAN = (-110.0, 70.0)  # px, of the camera while the target is hidden
FOUND_BY = HIDDEN[-1] + 35  # a search has tried all its positions several times


class DriftingTracker:
    """Finds the target near the search position; otherwise drifts by 6 pixels per frame."""

    can_seek, reseek_below = True, 0.0

    def __init__(self, frames, truth):
        """`truth` has the target's box in each raw frame, None where it is hidden."""
        self._truth = {id(frame): box for frame, box in zip(frames, truth, strict=True)}

    def init(self, view, xywh):
        self._xywh = xywh

    def track(self, view):
        truth = self._truth[id(view.raw)]
        visible = None if truth is None else map_box(view.stab_from_raw, truth)
        if visible is not None and distance(visible, self._xywh) < 0.7:
            self._xywh = visible
            return Track(self._xywh, 0.95)
        x, y, w, h = self._xywh
        self._xywh = x + 6, y - 3, w, h
        return Track(self._xywh, 0.02)

    def seek(self, view, xywh):
        self._xywh = xywh
        return self.track(view)


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
