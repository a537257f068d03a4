"""A `following` frame does not change results; a given motion is used."""

import numpy as np
import pytest

import ssiam
from helpers.synthetic import camera_frame, generator, poses, world
from ssiam import Motion
from ssiam.geometry import rigid
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker

SIZE = (320, 240)
BOXES = [(130.0, 90.0, 40.0, 50.0), (40.0, 40.0, 36.0, 30.0), (240.0, 150.0, 30.0, 40.0)]
METHODS = ["predict", "paper", "off"]


@pytest.fixture(scope="module")
def frames():
    scene = world(size_wh=SIZE)
    path = poses(generator(2).normal(0, (5, 3, 0.01), (14, 3)), SIZE)
    return [camera_frame(scene, pose) for pose in path]


def content(track):
    """The fields of a track in a comparable form."""
    motion = None if track.motion is None else track.motion.cur_from_prev.tolist()
    view = None if track.stab_from_raw is None else track.stab_from_raw.tolist()
    return track.box, track.score, track.lost, track.evidence, motion, view


def single(frames, stabilize, is_announced):
    tracker = ssiam.load_tracker("kcf", stabilize=stabilize)
    tracker.init(frames[0], BOXES[0])
    following = [*frames[2:], None]
    return [
        content(tracker.update(frame, following=after if is_announced(t) else None))
        for t, (frame, after) in enumerate(zip(frames[1:], following, strict=True))
    ]


def several(frames, stabilize, is_announced):
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf", stabilize=stabilize))
    group.init(frames[0], BOXES)
    following = [*frames[2:], None]
    return [
        [content(track) for track in group.update(frame, after if is_announced(t) else None)]
        for t, (frame, after) in enumerate(zip(frames[1:], following, strict=True))
    ]


@pytest.mark.parametrize("run", [single, several])
@pytest.mark.parametrize("stabilize", METHODS)
def test_a_following_frame_does_not_change_results(frames, run, stabilize):
    alone = run(frames, stabilize, lambda t: False)
    assert run(frames, stabilize, lambda t: True) == alone
    assert run(frames, stabilize, lambda t: t % 3 == 1) == alone


def test_another_frame_than_the_following_one_is_refused(frames):
    tracker = ssiam.load_tracker("kcf")
    tracker.init(frames[0], BOXES[0])
    tracker.update(frames[1], following=frames[2])
    with pytest.raises(ValueError, match="another frame was started"):
        tracker.update(frames[3])


def test_a_new_target_discards_the_following_frame(frames):
    tracker, fresh = ssiam.load_tracker("kcf"), ssiam.load_tracker("kcf")
    tracker.init(frames[0], BOXES[0])
    tracker.update(frames[1], following=frames[2])
    for each in (tracker, fresh):
        each.init(frames[5], BOXES[1])
    assert content(tracker.update(frames[6])) == content(fresh.update(frames[6]))


@pytest.mark.parametrize("announced", [True, False])
def test_a_following_frame_of_another_size_is_refused_by_its_update(frames, announced):
    tracker, odd = ssiam.load_tracker("kcf"), world(size_wh=(160, 120))
    tracker.init(frames[0], BOXES[0])
    tracker.update(frames[1], following=odd if announced else None)
    with pytest.raises(ssiam.FrameSizeError, match=r"160x120.*320x240"):
        tracker.update(odd)


class StillTracker:
    """Reports the first box in every view."""

    can_seek, reseek_below = True, 0.0

    def init(self, view, xywh):
        self.xywh = xywh

    def update(self, view):
        return Track(self.xywh)

    def seek(self, view, xywh):
        self.xywh = xywh
        return self.update(view)

    def clone(self):
        return StillTracker()


@pytest.mark.parametrize("stabilize", ["predict", "paper"])
def test_a_given_motion_is_used(frames, stabilize):
    """All frames are equal, and the given motions are not zero."""
    tracker = StabilizedTracker(
        StillTracker(), ssiam.StabilizerConfig(stabilize).with_options(choose=False, gate=0)
    )
    tracker.init(frames[0], BOXES[0])
    motions = [Motion.from_transform(rigid(dx, -dx, 0.0), SIZE) for dx in (8, -8, 8)]
    tracks = [tracker.update(frames[0].copy(), motion=motion) for motion in motions]
    for track, motion in zip(tracks, motions, strict=True):
        assert track.motion is motion
    assert np.abs(tracks[-1].stab_from_raw[:2, 2]).min() > 2
    still = tracker.update(frames[0].copy())  # without a motion it is estimated
    assert still.motion.shift_angle == pytest.approx((0, 0, 0), abs=0.05)


def test_off_has_no_motion_estimator(frames):
    tracker = ssiam.load_tracker("kcf", stabilize="off")
    tracker.init(frames[0], BOXES[0])
    assert tracker.update(frames[1]).motion is None
    assert tracker.new_camera() is None


def test_a_group_gives_the_results_of_its_trackers_with_one_motion(frames):
    group = ssiam.TrackerGroup(ssiam.load_tracker("kcf"))
    group.init(frames[0], BOXES)
    alone = [ssiam.load_tracker("kcf") for _ in BOXES]
    for tracker, box in zip(alone, BOXES, strict=True):
        tracker.init(frames[0], box)
    for frame in frames[1:]:
        tracks = group.update(frame)
        motion = tracks[0].motion
        assert {id(track.motion) for track in tracks} == {id(motion)}
        for tracker, track in zip(alone, tracks, strict=True):
            assert content(tracker.update(frame, motion=motion)) == content(track)
