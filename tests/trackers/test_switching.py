"""Another steadying while it runs: the target is kept."""

import numpy as np
import pytest

import ssiam
from helpers.synthetic import generator, poses, seen, world
from ssiam import StabilizerConfig
from ssiam.geometry import iou, map_box
from ssiam.track import Track
from ssiam.trackers import SteadiedTracker

SIZE = (320, 240)
BOX = (130.0, 90.0, 40.0, 50.0)
METHODS = ["off", "paper", "predict"]


class NotedTracker:
    """Answers what it is told, and notes how often it is given a template."""

    def __init__(self, doubt):
        self.doubt = doubt
        self.templates = 0

    def init(self, view, xywh):
        self.templates += 1
        self.xywh = xywh

    def track(self, view):
        return Track(self.xywh, score=0.9)

    def seek(self, view, xywh):
        self.xywh = xywh
        return self.track(view)

    def another(self):
        return NotedTracker(self.doubt)


@pytest.fixture(scope="module")
def shaken():
    path = poses(generator(4).normal(0, (5, 3, 0.01), (30, 3)), SIZE)
    picture = world(size_wh=SIZE)
    return [seen(picture, pose) for pose in path], path


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


@pytest.mark.parametrize(("doubt", "templates"), [(0.0, 1), (None, 2)], ids=["told", "not told"])
def test_the_template_is_kept_where_a_tracker_can_be_told_where_to_look(shaken, doubt, templates):
    frames, _ = shaken
    noted = NotedTracker(doubt)
    tracker = SteadiedTracker(noted, StabilizerConfig("paper"))
    tracker.init(frames[0], BOX)
    box = tracker.update(frames[1]).box
    tracker.switch(StabilizerConfig("off"), frames[1])
    assert noted.templates == templates
    assert tracker.update(frames[2]).box == box
    assert tracker.config.stabilize == "off"


def test_a_lost_target_stays_lost(shaken):
    frames, _ = shaken
    noted = NotedTracker(0.0)
    tracker = SteadiedTracker(noted, StabilizerConfig("off"))
    tracker.init(frames[0], BOX)
    noted.track = lambda view: Track(BOX, score=0.0)
    while not tracker.update(frames[1]).lost:
        pass
    tracker.switch(StabilizerConfig("predict"), frames[1])
    assert tracker.update(frames[2]).lost


def test_before_there_is_a_target_only_the_method_changes(shaken):
    frames, _ = shaken
    tracker = ssiam.load_tracker("kcf", stabilize="off")
    tracker.switch(StabilizerConfig("paper"), frames[0])
    tracker.init(frames[0], BOX)
    assert tracker.update(frames[1]).motion is not None


def test_targets_of_a_group_come_and_go(shaken):
    frames, path = shaken
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize="predict"))
    group.init(frames[0], [])
    assert group.update(frames[1]) == []
    assert group.motion is not None
    late = group.another()
    late.init(frames[1], BOX)
    group.join(late, BOX)
    for frame in frames[2:6]:
        (track,) = group.update(frame)
    there = map_box(path[5] @ np.linalg.inv(path[1]), BOX)
    assert overlap(track.box, there) > 0.5
    group.leave(late)
    assert group.update(frames[6]) == []
