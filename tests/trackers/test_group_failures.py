"""A group in which one tracker fails: with `keep_going` the others continue."""

import numpy as np
import pytest

import ssiam
from helpers.failing_trackers import every_tenth, failing_tracker
from helpers.synthetic import golden_video
from ssiam.errors import FrameSizeError, TrackingError
from ssiam.motion import CameraMotion

OTHER = (20.0, 30.0, 40.0, 40.0)


@pytest.fixture(scope="module")
def video():
    return golden_video("A")


@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
def test_the_other_targets_are_tracked_as_without_the_failure(video, stabilize):
    frames, box = video
    alone = ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize=stabilize))
    alone.init(frames[0], [box])
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize=stabilize), keep_going=True)
    group.init(frames[0], [box])
    failing = failing_tracker(every_tenth, stabilize)
    failing.init(frames[0], OTHER)
    group.join(failing, OTHER)
    failed = []
    for number, frame in enumerate(frames[1:25], 1):
        (expected,), (track, other) = alone.update(frame), group.update(frame)
        if stabilize == "off":
            assert track.box == expected.box
        assert set(group.failures) == ({1} if number % 10 == 0 else set())
        failed += [other] if group.failures else []
    assert {(track.lost, track.score) for track in failed} == {(True, 0.0)}


def test_without_keep_going_the_error_is_raised(video):
    frames, box = video
    group = ssiam.TrackerGroup(failing_tracker(every_tenth))
    group.init(frames[0], [box])
    for frame in frames[1:10]:
        group.update(frame)
    with pytest.raises(TrackingError, match="come apart"):
        group.update(frames[10])


def test_camera_motion_that_fails_is_unreliable(video, monkeypatch):
    frames, box = video
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize="predict"), keep_going=True)
    group.init(frames[0], [box])
    with monkeypatch.context() as patched:
        patched.setattr(CameraMotion, "update", lambda *given: 1 / 0)
        group.update(frames[1])
    assert isinstance(group.camera_failure, ZeroDivisionError)
    assert not group.motion.reliable
    group.update(frames[2])
    assert group.camera_failure is None


def test_a_frame_of_another_size_is_always_refused(video):
    frames, box = video
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize="off"), keep_going=True)
    group.init(frames[0], [box])
    with pytest.raises(FrameSizeError):
        group.update(np.ascontiguousarray(frames[1][:-2]))


def test_a_tracker_that_fails_to_switch_is_reported(video):
    frames, box = video
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize="off"), keep_going=True)
    group.init(frames[0], [box, OTHER])
    second = group._trackers[1]
    second.switch = lambda config, frame: 1 / 0
    group.switch(ssiam.StabilizerConfig("predict"), frames[0])
    assert set(group.failures) == {1}
    group.leave(second)
    assert len(group.update(frames[1])) == 1
