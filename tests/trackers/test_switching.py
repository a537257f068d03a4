"""Switching the stabilization during tracking: the target is kept."""

import numpy as np
import pytest

import ssiam
from helpers.synthetic import camera_frame, generator, poses, world
from ssiam import StabilizerConfig
from ssiam.geometry import iou, map_box
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker

SIZE = (320, 240)
BOX = (130.0, 90.0, 40.0, 50.0)
METHODS = ["off", "paper", "predict"]


class RecordingTracker:
    """Reports the box of the last `init` or `seek`, and counts the templates."""

    reseek_below = 0.0

    def __init__(self, can_seek):
        self.can_seek = can_seek
        self.templates = 0

    def init(self, view, xywh):
        self.templates += 1
        self.xywh = xywh

    def update(self, view):
        return Track(self.xywh, score=0.9)

    def seek(self, view, xywh):
        self.xywh = xywh
        return self.update(view)

    def clone(self):
        return RecordingTracker(self.can_seek)


@pytest.fixture(scope="module")
def shaken():
    path = poses(generator(4).normal(0, (5, 3, 0.01), (30, 3)), SIZE)
    scene = world(size_wh=SIZE)
    return [camera_frame(scene, pose) for pose in path], path


def overlap(a, b):
    return iou(np.array([a]), np.array([b]))[0]


@pytest.mark.parametrize("before", METHODS)
@pytest.mark.parametrize("after", METHODS)
def test_a_real_tracker_keeps_its_target(shaken, before, after):
    frames, path = shaken
    tracker = ssiam.load_tracker("csrt", stabilize=before)
    tracker.init(frames[0], BOX)
    for frame in frames[1:10]:
        tracker.update(frame)
    tracker.switch(StabilizerConfig(after), frames[9])
    tracks = [tracker.update(frame) for frame in frames[10:20]]
    world_from_first = np.linalg.inv(path[0])
    for pose, track in zip(path[10:20], tracks, strict=True):
        assert (track.motion is None) == (after == "off")
        assert overlap(track.box, map_box(pose @ world_from_first, BOX)) > 0.5


@pytest.mark.parametrize(("can_seek", "templates"), [(True, 1), (False, 2)])
def test_the_template_is_kept_by_trackers_that_can_seek(shaken, can_seek, templates):
    frames, _ = shaken
    recording = RecordingTracker(can_seek)
    tracker = StabilizedTracker(recording, StabilizerConfig("paper"))
    tracker.init(frames[0], BOX)
    box = tracker.update(frames[1]).box
    tracker.switch(StabilizerConfig("off"), frames[1])
    assert recording.templates == templates
    assert tracker.update(frames[2]).box == box
    assert tracker.config.stabilize == "off"


def test_a_lost_target_stays_lost(shaken):
    frames, _ = shaken
    recording = RecordingTracker(can_seek=True)
    tracker = StabilizedTracker(recording, StabilizerConfig("off"))
    tracker.init(frames[0], BOX)
    recording.update = lambda view: Track(BOX, score=0.0)
    while not tracker.update(frames[1]).lost:
        pass
    tracker.switch(StabilizerConfig("predict"), frames[1])
    assert tracker.update(frames[2]).lost


def test_without_a_target_only_the_method_changes(shaken):
    frames, _ = shaken
    tracker = ssiam.load_tracker("kcf", stabilize="off")
    tracker.switch(StabilizerConfig("paper"), frames[0])
    tracker.init(frames[0], BOX)
    assert tracker.update(frames[1]).motion is not None


def test_targets_join_and_leave_a_group(shaken):
    frames, path = shaken
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize="predict"))
    group.init(frames[0], [])
    assert group.update(frames[1]) == []
    assert group.motion is not None
    late = group.new_tracker()
    late.init(frames[1], BOX)
    group.join(late, BOX)
    for frame in frames[2:6]:
        (track,) = group.update(frame)
    expected = map_box(path[5] @ np.linalg.inv(path[1]), BOX)
    assert overlap(track.box, expected) > 0.5
    group.leave(late)
    assert group.update(frames[6]) == []
