"""A group: which boxes are excluded from the motion estimate, and which failures are kept."""

import numpy as np
import pytest

from helpers.synthetic import world
from ssiam import Motion, StabilizerConfig, TrackerGroup
from ssiam.errors import ArgumentError, FrameSizeError, TrackingError
from ssiam.geometry import rigid
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker
from ssiam.trackers.stabilized import _first_box, _raw_view, _touching

SIZE = (320, 240)
FRAME = world(1, SIZE)
FIRST, SECOND = (100.0, 80.0, 40.0, 30.0), (200.0, 100.0, 20.0, 30.0)


class Scripted:
    """Reports its box, moved by (dx, 0) in each frame; or raises."""

    can_seek, reseek_below, center_inset = True, 0.0, 1.0

    def __init__(self, dx=0.0, score=0.9):
        self.dx, self.score, self.error, self.inits = dx, score, None, []

    def clone(self):
        return Scripted(self.dx, self.score)

    def init(self, view, xywh):
        self.xywh = xywh
        self.inits.append((view, xywh))

    def update(self, view):
        if self.error is not None:
            raise self.error
        x, y, w, h = self.xywh
        self.xywh = x + self.dx, y, w, h
        return Track(self.xywh, self.score)

    def seek(self, view, xywh):
        self.xywh = xywh
        return self.update(view)


class Camera:
    """Returns given motions, or raises; records the excluded boxes and the started frames."""

    def __init__(self, motion=None):
        self.motion = motion or Motion.none(SIZE, reliable=True)
        self.excluded, self.started, self.error = [], [], None

    def update(self, frame, exclude=None, motion=None):
        self.excluded.append(exclude)
        if self.error is not None:
            raise self.error
        return self.motion

    def start(self, frame, exclude=None):
        self.started.append((frame, exclude))


def made(stabilize="off", boxes=(FIRST, SECOND), dx=3.0, **options):
    tracker = StabilizedTracker(Scripted(dx), StabilizerConfig(stabilize))
    group = TrackerGroup(tracker, **options)
    group.init(FRAME, list(boxes))
    if stabilize != "off":
        group._camera = Camera()
    return group


def inner(group, index):
    return group._trackers[index].view_tracker.tracker


def test_tracks_have_the_order_of_the_boxes():
    group = made()
    assert [track.box for track in group.update(FRAME)] == [
        (103.0, 80.0, 40.0, 30.0),
        (203.0, 100.0, 20.0, 30.0),
    ]
    assert group.motion is None
    assert dict(group.failures) == {}
    assert group.camera_failure is None


def test_the_last_boxes_are_excluded():
    group = made("paper")
    camera = group._camera
    group.update(FRAME)
    group.update(FRAME)
    assert camera.excluded[0] == [FIRST, SECOND]
    assert [box[0] for box in camera.excluded[1]] == [103, 203]
    assert group.motion is camera.motion


def test_predicted_boxes_are_excluded_and_the_following_frame_is_started():
    group = made("predict", dx=0.0)
    camera = group._camera
    following = FRAME.copy()
    camera.motion = Motion.from_transform(rigid(6, 0, 0), SIZE)
    group.update(FRAME, following)
    ((frame, exclude),) = camera.started
    assert frame is following
    assert [box[0] for box in exclude] == pytest.approx([106, 206])
    group.update(following)
    assert [box[0] for box in camera.excluded[1]] == pytest.approx([106, 206])
    assert len(camera.started) == 1


def test_a_following_frame_is_not_started_without_predictions_or_of_another_size():
    group = made("paper")
    group.update(FRAME, FRAME.copy())
    assert group._camera.started == []
    group = made("predict")
    group.update(FRAME, world(1, (160, 120)))
    assert group._camera.started == []
    group.update(FRAME)
    assert group._camera.started == []
    assert len(made("off").update(FRAME, FRAME.copy())) == 2


def test_without_targets_the_motion_is_estimated_ahead():
    group = made("predict", boxes=())
    assert group.update(FRAME, FRAME.copy()) == []
    assert group._camera.started[0][1] == []


def test_a_failed_tracker_keeps_its_last_box_and_runs_again():
    group = made("paper", keep_going=True)
    group.update(FRAME)
    before = group._exclude[1]
    error = inner(group, 1).error = RuntimeError("broken")
    first, second = group.update(FRAME)
    assert not first.lost
    assert (second.box, second.score, second.lost) == (before, 0, True)
    assert second.motion is group.motion
    assert {index: each.__cause__ for index, each in group.failures.items()} == {1: error}
    assert str(group.failures[1]) == "Scripted.update failed: RuntimeError: broken"
    inner(group, 1).error = None
    assert group.update(FRAME)[1].score == 0.9
    assert dict(group.failures) == {}


def test_a_failed_prediction_does_not_start_the_following_frame():
    group = made("predict", keep_going=True)
    group._camera.motion = None  # refused by each `advance`
    tracks = group.update(FRAME, FRAME.copy())
    assert set(group.failures) == {0, 1}
    assert [track.box for track in tracks] == [FIRST, SECOND]
    assert group._camera.started == []


def test_a_failed_camera_gives_an_unreliable_motion():
    group = made("paper", keep_going=True)
    error = group._camera.error = RuntimeError("broken")
    group.update(FRAME)
    assert group.camera_failure is error
    assert (group.motion.reliable, group.motion.size_wh) == (False, SIZE)
    group._camera.error = FrameSizeError("size")
    with pytest.raises(FrameSizeError):
        group.update(FRAME)
    strict = made("paper")
    strict._camera.error = RuntimeError("broken")
    with pytest.raises(RuntimeError, match="broken"):
        strict.update(FRAME)


def test_a_frame_of_another_size_is_an_error_of_all():
    group = made(keep_going=True)
    inner(group, 0).error = FrameSizeError("size")
    with pytest.raises(FrameSizeError):
        group.update(FRAME)
    with pytest.raises(FrameSizeError, match="160x120 pixels after frames of 320x240"):
        group.update(world(1, (160, 120)))
    with pytest.raises(FrameSizeError, match="160x120 pixels after frames of 320x240"):
        made(boxes=()).update(world(1, (160, 120)))


def test_a_group_without_a_frame_is_refused():
    group = TrackerGroup(StabilizedTracker(Scripted(), StabilizerConfig("off")))
    for call in (lambda: group.update(FRAME), lambda: group.join(group.new_tracker(), FIRST)):
        with pytest.raises(ArgumentError, match="no target yet"):
            call()


def started(group, box=FIRST):
    tracker = group.new_tracker()
    tracker.init(FRAME, box)
    return tracker


def test_who_may_join():
    group = made(boxes=(FIRST,))
    with pytest.raises(ArgumentError, match="has no target"):
        group.join(group.new_tracker(), SECOND)
    with pytest.raises(ArgumentError, match="has no target"):
        group.join("tracker", SECOND)
    other = StabilizedTracker(Scripted(), StabilizerConfig("paper"))
    other.init(FRAME, FIRST)
    with pytest.raises(ArgumentError, match="stabilizes by 'paper' or by other numbers"):
        group.join(other, SECOND)
    third = started(group, SECOND)
    with pytest.raises(ArgumentError, match="box is 'x'"):
        group.join(third, "x")
    group.join(third, SECOND)
    with pytest.raises(ArgumentError, match="in the group already"):
        group.join(third, SECOND)
    assert len(group.update(FRAME)) == 2


def test_who_leaves_is_not_excluded_any_more():
    group = made("paper", boxes=(FIRST, SECOND, FIRST))
    first, second, third = group._trackers
    group.leave(second)
    assert group._trackers == [first, third]
    assert [tuple(box) for box in group._exclude] == [FIRST, FIRST]
    group.leave(first)
    assert group._trackers == [third]
    with pytest.raises(ArgumentError, match="not in the group"):
        group.leave(first)
    group.join(started(group, SECOND), list(SECOND))
    assert [tuple(box) for box in group._exclude] == [FIRST, SECOND]


@pytest.mark.parametrize("boxes", ["1234", b"12", {1}, {"a": 1}, 5, [1, 2, 3, 4], (FIRST, 7), None])
def test_what_is_not_a_list_of_boxes(boxes):
    group = made()
    with pytest.raises(ArgumentError, match=r"^boxes is .*: give a list of"):
        group.init(FRAME, boxes)
    assert len(group.update(FRAME)) == 2, "the earlier targets are kept"


def test_boxes_may_be_any_sequence():
    group = made()
    for boxes in (np.array([FIRST, SECOND]), iter([FIRST]), (list(FIRST),)):
        expected = 2 if isinstance(boxes, np.ndarray) else 1
        given = boxes if isinstance(boxes, (np.ndarray, tuple)) else list(boxes)
        group.init(FRAME, given)
        assert len(group.update(FRAME)) == expected


def test_switching_changes_each_tracker_and_the_camera():
    group = made("off")
    group.update(FRAME)
    group.switch(StabilizerConfig("paper"), FRAME)
    assert {each.config.stabilize for each in group._trackers} == {"paper"}
    assert group.new_tracker().config.stabilize == "paper"
    assert group._camera is not None
    assert group.motion.reliable
    group.switch(StabilizerConfig("off"), FRAME)
    assert (group._camera, group.motion) == (None, None)
    with pytest.raises(FrameSizeError):
        group.switch(StabilizerConfig("off"), world(1, (160, 120)))


def test_failures_of_a_switch_are_kept():
    group = made("off", keep_going=True)
    error = inner(group, 1).error = RuntimeError("broken")
    group.switch(StabilizerConfig("paper"), FRAME)
    assert {index: each.__cause__ for index, each in group.failures.items()} == {1: error}
    assert group._trackers[0].config.stabilize == "paper"
    strict = made("off")
    inner(strict, 1).error = RuntimeError("broken")
    with pytest.raises(TrackingError, match="broken"):
        strict.switch(StabilizerConfig("paper"), FRAME)


@pytest.mark.parametrize(
    ("xywh", "touching"),
    [
        ((10.0, 20.0, 30.0, 40.0), (10, 20, 30, 40)),
        ((-31.0, -41.0, 30.0, 40.0), (-30, -40, 30, 40)),
        ((321.0, 241.0, 30.0, 40.0), (320, 240, 30, 40)),
        ((-29.0, 239.0, 30.0, 40.0), (-29, 239, 30, 40)),
    ],
)
def test_lost_boxes_touch_the_frame(xywh, touching):
    assert _touching(xywh, SIZE) == touching


def test_first_boxes():
    tracker = Scripted()
    assert _first_box([10, 20, 30, 40], SIZE, tracker) == (10, 20, 30, 40)
    corners = [10, 20, 49, 20, 49, 79, 10, 79]
    assert _first_box(corners, SIZE, tracker) == pytest.approx((10, 20, 40, 60))
    tracker.center_inset = 0.0
    assert _first_box(corners, SIZE, tracker) == pytest.approx((9.5, 19.5, 40, 60))
    for line in ([10, 20, 30, 20, 30, 20, 10, 20], [10, 20, 10, 40, 10, 40, 10, 20]):
        with pytest.raises(ArgumentError, match="corners are on one line"):
            _first_box(line, SIZE, tracker)
    with pytest.raises(ArgumentError, match="has 7 numbers"):
        _first_box(corners[:7], SIZE, tracker)
    with pytest.raises(ArgumentError, match="is outside"):
        _first_box(np.add(corners, 900), SIZE, tracker)


@pytest.mark.parametrize(("method", "border"), [("off", 0), ("paper", 7), ("predict", 7)])
def test_trackers_start_on_the_raw_view_with_the_border_of_the_method(method, border):
    config = StabilizerConfig(method).with_options(border=7)
    assert _raw_view(FRAME, config).border == border
    tracker = StabilizedTracker(Scripted(), config)
    tracker.init(FRAME, FIRST)
    ((view, box),) = tracker.view_tracker.tracker.inits
    assert (view.raw is FRAME, view.is_raw, view.border, box) == (True, True, border, FIRST)


def test_a_refused_frame_does_not_reach_the_camera():
    tracker = StabilizedTracker(Scripted(), StabilizerConfig("predict"))
    tracker.init(FRAME, FIRST)
    camera = tracker._target.camera = Camera()
    odd = world(1, (160, 120))
    with pytest.raises(FrameSizeError, match="160x120 pixels after frames of 320x240"):
        tracker.update(odd)
    with pytest.raises(ArgumentError, match="a frame is a"):
        tracker.update(FRAME, following="next")
    with pytest.raises(ArgumentError, match="motion has size_wh"):
        tracker.update(FRAME, motion=Motion.none((160, 120)))
    assert camera.excluded == []


class Unknown:
    """A camera whose motions are not reliable."""

    def update(self, frame, exclude=None, motion=None):
        return Motion.none(SIZE)


@pytest.mark.parametrize(("score", "held"), [(0.1, True), (0.11, False)])
def test_a_target_that_is_not_visible_after_an_unknown_motion_is_held(score, held):
    """The tracker is that of before the frame."""
    scripted = Scripted(dx=50.0, score=score)
    tracker = StabilizedTracker(scripted, StabilizerConfig("paper"))
    tracker.init(FRAME, FIRST)
    tracker._target.camera = Unknown()
    track = tracker.update(FRAME)
    assert track.box[0] == (100 if held else 150)
    assert track.score == (0 if held else score)
    assert tracker.view_tracker.tracker.xywh[0] == (100 if held else 150)
    assert tracker._target.xywh == track.box


def test_a_known_motion_with_a_low_score_is_not_held():
    tracker = StabilizedTracker(Scripted(dx=50.0, score=0.0), StabilizerConfig("paper"))
    tracker.init(FRAME, FIRST)
    tracker._target.camera = Camera()
    assert tracker.update(FRAME).box[0] == 150
