"""A target that is covered, or cut away, while the camera shakes and pans; and found again."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import ssiam
from helpers.tracker_scenes import (
    COVERED,
    ELSEWHERE,
    OPEN,
    SCENE,
    SIZE,
    TARGET,
    apart,
    pasted,
    shaken_pan,
    shown,
    target_in,
    textured,
)
from ssiam.geometry import corners_from_xywh, map_box, rigid
from ssiam.track import Track
from ssiam.trackers import SteadiedTracker

COUNT, HIDDEN = 110, range(40, 70)
CONFIG = ssiam.StabilizerConfig()


class Scripted:
    """Sees the target where it is, if that is near where it looks; else stays, without score."""

    doubt = 0.0

    def __init__(self, frames, truth):
        """`truth` has the target's raw box of each frame, None where it is hidden."""
        self._truth = {id(frame): box for frame, box in zip(frames, truth, strict=True)}

    def init(self, view, xywh):
        self._xywh = xywh

    def track(self, view):
        truth = self._truth[id(view.raw)]
        seen = None if truth is None else map_box(view.stab_from_raw, truth)
        found = seen is not None and apart(seen, self._xywh) < 1.5
        self._xywh = seen if found else self._xywh
        mask = np.ones((SIZE[1], SIZE[0]), bool)
        return Track(self._xywh, 0.95 if found else 0.02, False, corners_from_xywh(TARGET), mask)

    def seek(self, view, xywh):
        self._xywh = xywh
        return self.track(view)


class Confused(Scripted):
    """Takes what stands beside the target for it while it is hidden, after a frame of doubt."""

    def __init__(self, frames, path):
        truth = [None if t in HIDDEN else target_in(pose) for t, pose in enumerate(path)]
        super().__init__(frames, truth)
        x, y, w, h = TARGET
        beside = (x + 1.4 * w, y, w, h)
        self._doubles = {
            id(frame): map_box(pose, beside)
            for t, (frame, pose) in enumerate(zip(frames, path, strict=True))
            if t in HIDDEN[1:]
        }

    def track(self, view):
        track = super().track(view)
        double = self._doubles.get(id(view.raw))
        if double is None:
            return track
        self._xywh = map_box(view.stab_from_raw, double)
        return replace(track, box=self._xywh, score=0.7)


class Shy(Scripted):
    """Hardly believes in what it sees of the target from some frame on, and looks close by."""

    def __init__(self, frames, truth, shy):
        super().__init__(frames, truth)
        self._shy = {id(frames[t]) for t in shy}

    def track(self, view):
        truth = map_box(view.stab_from_raw, self._truth[id(view.raw)])
        if apart(truth, self._xywh) > 0.4:
            return Track(self._xywh, 0.02)
        self._xywh = truth
        return Track(truth, 0.1 if id(view.raw) in self._shy else 0.95)


@cache
def covered():
    """Frames in which a cover hides the target while the camera pans away and back."""
    path = shaken_pan(COUNT, HIDDEN)
    return [shown(COVERED if t in HIDDEN else OPEN, pose) for t, pose in enumerate(path)], path


@cache
def cut_away():
    """Frames that show another place for a while, and then the first one as it was."""
    path = shaken_pan(COUNT)
    return [shown(ELSEWHERE if t in HIDDEN else OPEN, pose) for t, pose in enumerate(path)], path


def tracked(kind, frames, path, config=CONFIG):
    """Tracks of all frames but the first, by KCF or by the script."""
    truth = [target_in(pose) for pose in path]
    if kind == "scripted":
        told = [None if t in HIDDEN else box for t, box in enumerate(truth)]
        tracker = SteadiedTracker(Scripted(frames, told), config)
    else:
        tracker = ssiam.load_tracker(kind, stabilize=config)
    tracker.init(frames[0], truth[0])
    return [tracker.update(frame) for frame in frames[1:]], truth


@pytest.fixture(scope="module", params=["kcf", "scripted"])
def hidden(request):
    """Tracks, and true boxes of the target, whether it is hidden or not."""
    return tracked(request.param, *covered())


def test_what_is_in_view_is_tracked_and_not_lost(hidden):
    tracks, truth = hidden
    for track, box in zip(tracks[: HIDDEN[0] - 1], truth[1:], strict=False):
        assert not track.lost
        assert track.score > 0.5
        assert apart(track.box, box) < 0.5


def test_what_is_covered_is_lost_and_its_place_is_kept(hidden):
    tracks, truth = hidden
    lost = [t for t, track in enumerate(tracks, start=1) if track.lost]
    assert HIDDEN[0] < lost[0] < HIDDEN[0] + 15
    assert set(range(lost[0], HIDDEN[-1])) <= set(lost)
    for t in set(lost) & set(HIDDEN):
        assert apart(tracks[t - 1].box, truth[t]) < 2


def test_what_was_lost_is_found_again(hidden):
    tracks, truth = hidden
    last = HIDDEN[-1] + 30
    for track, box in zip(tracks[last:], truth[last + 1 :], strict=True):
        assert not track.lost
        assert apart(track.box, box) < 0.5


def test_what_stands_beside_a_hidden_target_is_not_taken_for_it():
    path = shaken_pan(COUNT)
    frames = [shown(COVERED if t in HIDDEN else OPEN, pose) for t, pose in enumerate(path)]
    tracker = SteadiedTracker(Confused(frames, path), CONFIG)
    tracker.init(frames[0], target_in(path[0]))
    tracks = [None, *(tracker.update(frame) for frame in frames[1:])]
    assert all(tracks[t].lost for t in HIDDEN[10:])
    for t in range(HIDDEN[-1] + 10, COUNT):
        assert not tracks[t].lost
        assert apart(tracks[t].box, target_in(path[t])) < 0.5


def test_a_target_that_the_camera_follows_is_sought_in_the_picture():
    """Though the scene passes by: by half a target's size a frame, to and fro."""
    there = 190 * np.sin((np.arange(COUNT) - 20).clip(0) / 7.5)
    path = [rigid(-200 - x, -100, 0) for x in there]
    box = (178.0, 130.0, *TARGET[2:])
    frames = [pasted(shown(SCENE, pose), textured(11, (44, 40)), 178, 130) for pose in path]
    tracker = SteadiedTracker(Shy(frames, [box] * COUNT, range(30, COUNT)), CONFIG)
    tracker.init(frames[0], box)
    tracks = [tracker.update(frame) for frame in frames[1:]]
    assert tracks[-1].lost
    assert max(apart(track.box, box) for track in tracks) < 0.5


def test_a_target_that_jumps_in_sight_is_not_lost():
    frames, path = [shown(OPEN, pose) for pose in shaken_pan(40)], shaken_pan(40)
    there = [rigid(50.0 * (t >= 20), 0, 0) @ pose for t, pose in enumerate(path)]
    truth = [target_in(pose) for pose in there]
    tracker = SteadiedTracker(Scripted(frames, truth), CONFIG)
    tracker.init(frames[0], truth[0])
    for frame, box in zip(frames[1:], truth[1:], strict=True):
        track = tracker.update(frame)
        assert not track.lost
        assert apart(track.box, box) < 0.5


def test_lost_tracks_have_no_shape_but_motion_and_view(hidden):
    tracks, _ = hidden
    for track in tracks:
        assert 0 <= track.score <= 1
        assert track.motion is not None
        assert track.stab_from_raw.shape == (3, 3)
        if track.lost:
            assert track.corners is None
            assert track.mask is None


def test_tracks_that_are_not_lost_have_their_shape():
    tracks, _ = tracked("scripted", *covered())
    shapes = {(track.lost, track.corners is None, track.mask is None) for track in tracks}
    assert shapes == {(True, True, True), (False, False, False)}


@pytest.mark.parametrize("kind", ["kcf", "scripted"])
def test_without_finding_nothing_is_ever_lost(kind):
    tracks, _ = tracked(kind, *covered(), replace(CONFIG, find=False))
    assert not any(track.lost for track in tracks)


@pytest.mark.parametrize("kind", ["kcf", "scripted"])
def test_after_a_cut_to_elsewhere_and_back_the_target_is_found(kind):
    tracks, truth = tracked(kind, *cut_away())
    assert all(track.lost for track in tracks[HIDDEN[0] + 14 : HIDDEN[-1]])
    last = HIDDEN[-1] + 30
    for track, box in zip(tracks[last:], truth[last + 1 :], strict=True):
        assert not track.lost
        assert apart(track.box, box) < 0.5


@pytest.mark.parametrize("stabilize", ["paper", "off"])
def test_in_other_modes_what_is_covered_is_lost_as_well(stabilize):
    frames, path = covered()
    tracks, _ = tracked("scripted", frames, path, ssiam.StabilizerConfig(stabilize))
    assert not any(track.lost for track in tracks[: HIDDEN[0] - 1])
    assert all(track.lost for track in tracks[HIDDEN[0] + 14 : HIDDEN[-1]])


@pytest.mark.parametrize("name", ["kcf", "csrt"])
def test_a_target_that_a_view_does_not_show_is_sought_without_an_error(name):
    """The raw frame has it, the rendered view has not: it was moved too far."""
    frame, box = shown(OPEN, shaken_pan(1)[0]), target_in(shaken_pan(1)[0])
    tracker = ssiam.load_tracker(name, stabilize="off").another()._tracker
    tracker.init(ssiam.FrameView(frame), box)
    for dx, dy in ((300, 0), (-300, 0), (0, 260), (0, -260), (212, 0)):
        view = ssiam.FrameView(frame, rigid(dx, dy, 0))
        track = tracker.seek(view, map_box(view.stab_from_raw, box))
        assert np.isfinite(track.box).all()
