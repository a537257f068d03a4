"""Targets that are occluded, or invisible after a cut, under a shaking camera; re-detection."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import ssiam
from helpers.tracker_scenes import (
    COVERED,
    OPEN,
    OTHER_SCENE,
    SCENE,
    TARGET,
    ScriptedTracker,
    distance,
    filmed,
    shaking_pan,
    target_box,
    textured,
    with_patch,
)
from ssiam.geometry import map_box, rigid
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker

COUNT, HIDDEN = 110, range(40, 70)
CONFIG = ssiam.StabilizerConfig()


class DistractedTracker(ScriptedTracker):
    """Switches to a distractor next to the target one frame after the target is hidden."""

    def __init__(self, frames, path):
        truth = [None if t in HIDDEN else target_box(pose) for t, pose in enumerate(path)]
        super().__init__(frames, truth)
        x, y, w, h = TARGET
        distractor = (x + 1.4 * w, y, w, h)
        self._distractors = {
            id(frame): map_box(pose, distractor)
            for t, (frame, pose) in enumerate(zip(frames, path, strict=True))
            if t in HIDDEN[1:]
        }

    def update(self, view):
        track = super().update(view)
        distractor = self._distractors.get(id(view.raw))
        if distractor is None:
            return track
        self._xywh = map_box(view.stab_from_raw, distractor)
        return replace(track, box=self._xywh, score=0.7)


class LowScoreTracker(ScriptedTracker):
    """Finds the target only close to the search position; low scores in some frames."""

    def __init__(self, frames, truth, low_frames):
        super().__init__(frames, truth)
        self._low = {id(frames[t]) for t in low_frames}

    def update(self, view):
        truth = map_box(view.stab_from_raw, self._truth[id(view.raw)])
        if distance(truth, self._xywh) > 0.4:
            return Track(self._xywh, 0.02)
        self._xywh = truth
        return Track(truth, 0.1 if id(view.raw) in self._low else 0.95)


@cache
def covered():
    """Frames in which the target is covered while the camera pans away and back."""
    path = shaking_pan(COUNT, HIDDEN)
    return [filmed(COVERED if t in HIDDEN else OPEN, pose) for t, pose in enumerate(path)], path


@cache
def cut_away():
    """Frames with a cut to another scene, and back."""
    path = shaking_pan(COUNT)
    return [filmed(OTHER_SCENE if t in HIDDEN else OPEN, pose) for t, pose in enumerate(path)], path


def tracked(kind, frames, path, config=CONFIG):
    """Tracks of all frames but the first, by KCF or by the scripted tracker."""
    truth = [target_box(pose) for pose in path]
    if kind == "scripted":
        visible = [None if t in HIDDEN else box for t, box in enumerate(truth)]
        tracker = StabilizedTracker(ScriptedTracker(frames, visible), config)
    else:
        tracker = ssiam.load_tracker(kind, stabilize=config)
    tracker.init(frames[0], truth[0])
    return [tracker.update(frame) for frame in frames[1:]], truth


@pytest.fixture(scope="module", params=["kcf", "scripted"])
def hidden(request):
    """Tracks, and the target's true boxes whether it is hidden or not."""
    return tracked(request.param, *covered())


def test_a_visible_target_is_tracked_and_not_lost(hidden):
    tracks, truth = hidden
    for track, box in zip(tracks[: HIDDEN[0] - 1], truth[1:], strict=False):
        assert not track.lost
        assert track.score > 0.5
        assert distance(track.box, box) < 0.5


def test_a_covered_target_is_lost_and_its_position_is_kept(hidden):
    tracks, truth = hidden
    lost = [t for t, track in enumerate(tracks, start=1) if track.lost]
    assert HIDDEN[0] < lost[0] < HIDDEN[0] + 15
    assert set(range(lost[0], HIDDEN[-1])) <= set(lost)
    for t in set(lost) & set(HIDDEN):
        assert distance(tracks[t - 1].box, truth[t]) < 2


def test_a_lost_target_is_redetected(hidden):
    tracks, truth = hidden
    last = HIDDEN[-1] + 30
    for track, box in zip(tracks[last:], truth[last + 1 :], strict=True):
        assert not track.lost
        assert distance(track.box, box) < 0.5


def test_a_distractor_next_to_a_hidden_target_is_not_accepted():
    path = shaking_pan(COUNT)
    frames = [filmed(COVERED if t in HIDDEN else OPEN, pose) for t, pose in enumerate(path)]
    tracker = StabilizedTracker(DistractedTracker(frames, path), CONFIG)
    tracker.init(frames[0], target_box(path[0]))
    tracks = [None, *(tracker.update(frame) for frame in frames[1:])]
    assert all(tracks[t].lost for t in HIDDEN[10:])
    for t in range(HIDDEN[-1] + 10, COUNT):
        assert not tracks[t].lost
        assert distance(tracks[t].box, target_box(path[t])) < 0.5


def test_a_target_that_the_camera_follows_is_searched_in_the_frame():
    """The scene moves back and forth by half a target size per frame."""
    pan = 190 * np.sin((np.arange(COUNT) - 20).clip(0) / 7.5)
    path = [rigid(-200 - x, -100, 0) for x in pan]
    box = (178.0, 130.0, *TARGET[2:])
    patch = textured(11, (44, 40))
    frames = [with_patch(filmed(SCENE, pose), patch, 178, 130) for pose in path]
    low_frames = range(30, COUNT)
    tracker = StabilizedTracker(LowScoreTracker(frames, [box] * COUNT, low_frames), CONFIG)
    tracker.init(frames[0], box)
    tracks = [tracker.update(frame) for frame in frames[1:]]
    assert tracks[-1].lost
    assert max(distance(track.box, box) for track in tracks) < 0.5


def test_a_visible_target_that_jumps_is_not_lost():
    path = shaking_pan(40)
    frames = [filmed(OPEN, pose) for pose in path]
    truth = [target_box(rigid(50.0 * (t >= 20), 0, 0) @ pose) for t, pose in enumerate(path)]
    tracker = StabilizedTracker(ScriptedTracker(frames, truth), CONFIG)
    tracker.init(frames[0], truth[0])
    for frame, box in zip(frames[1:], truth[1:], strict=True):
        track = tracker.update(frame)
        assert not track.lost
        assert distance(track.box, box) < 0.5


def test_lost_tracks_have_motion_and_view_but_no_mask(hidden):
    tracks, _ = hidden
    for track in tracks:
        assert 0 <= track.score <= 1
        assert track.motion is not None
        assert track.stab_from_raw.shape == (3, 3)
        if track.lost:
            assert track.corners is None
            assert track.mask is None


def test_tracks_that_are_not_lost_have_mask_and_corners():
    tracks, _ = tracked("scripted", *covered())
    combinations = {(track.lost, track.corners is None, track.mask is None) for track in tracks}
    assert combinations == {(True, True, True), (False, False, False)}


@pytest.mark.parametrize("kind", ["kcf", "scripted"])
def test_with_find_off_no_target_is_ever_lost(kind):
    tracks, _ = tracked(
        kind, *covered(), ssiam.StabilizerConfig("predict").with_options(find=False)
    )
    assert not any(track.lost for track in tracks)


@pytest.mark.parametrize("kind", ["kcf", "scripted"])
def test_a_target_is_redetected_after_a_cut_away_and_back(kind):
    tracks, truth = tracked(kind, *cut_away())
    assert all(track.lost for track in tracks[HIDDEN[0] + 14 : HIDDEN[-1]])
    last = HIDDEN[-1] + 30
    for track, box in zip(tracks[last:], truth[last + 1 :], strict=True):
        assert not track.lost
        assert distance(track.box, box) < 0.5


@pytest.mark.parametrize("stabilize", ["paper", "off"])
def test_other_methods_also_lose_a_covered_target(stabilize):
    frames, path = covered()
    tracks, _ = tracked("scripted", frames, path, ssiam.StabilizerConfig(stabilize))
    assert not any(track.lost for track in tracks[: HIDDEN[0] - 1])
    assert all(track.lost for track in tracks[HIDDEN[0] + 14 : HIDDEN[-1]])


def test_prediction_without_a_motion_is_refused():
    frames, path = covered()
    tracker = StabilizedTracker(ScriptedTracker(frames, [None] * COUNT), CONFIG)
    tracker.init(frames[0], target_box(path[0]))
    with pytest.raises(ssiam.ArgumentError, match="no motion given"):
        tracker.advance(None)


@pytest.mark.parametrize("name", ["kcf", "csrt"])
def test_seeking_a_target_outside_of_the_view_does_not_fail(name):
    """The target is in the raw frame, but the shifted view does not show it."""
    pose = shaking_pan(1)[0]
    frame, box = filmed(OPEN, pose), target_box(pose)
    tracker = ssiam.load_tracker(name, stabilize="off").clone()._tracker
    tracker.init(ssiam.FrameView(frame), box)
    for dx, dy in ((300, 0), (-300, 0), (0, 260), (0, -260), (212, 0)):
        view = ssiam.FrameView(frame, rigid(dx, dy, 0))
        track = tracker.seek(view, map_box(view.stab_from_raw, box))
        assert np.isfinite(track.box).all()
