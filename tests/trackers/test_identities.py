"""Joint decisions about targets that are close to each other."""

import numpy as np
import pytest

import ssiam
from helpers.synthetic import world
from ssiam import FrameView
from ssiam.geometry import iou, rigid
from ssiam.motion import Motion
from ssiam.trackers.followers import FrameResponse
from ssiam.trackers.identities import TargetPath, decisions
from ssiam.trackers.responses import Response

SIZE = (320, 240)
FRAME = np.zeros((240, 320, 3), np.uint8)
STILL = Motion.none(SIZE, reliable=True)
SIDE = 20.0


def box(x, y=100.0, side=SIDE):
    return x, y, side, side


def moved_path(x, speed, frames=10):
    """A path that was at `x` in the last frame, and moves to the right."""
    path = TargetPath(box(x - speed * frames))
    for frame in range(1, frames + 1):
        path.advance(STILL)
        path.observe(box(x - speed * (frames - frame)))
    path.advance(STILL)
    return path


def response(*found):
    """A response with candidates of (box, score), the first one of the highest rank."""
    boxes = np.array([(x + w / 2, y + h / 2, w, h) for (x, y, w, h), _ in found]).T
    score = np.array([each for _, each in found])
    indices = np.arange(len(found))
    groups = [indices == each for each in indices]
    answer = Response(boxes, score, -indices.astype(float), lambda: groups, None)
    return FrameResponse(FrameView(FRAME), answer)


def test_a_path_continues_at_its_speed_and_with_the_camera():
    path = moved_path(100, 3.0)
    assert path.predicted == pytest.approx(box(103))
    path.advance(Motion.from_transform(rigid(10, 5, 0), SIZE))
    x, y, w, h = path.predicted
    assert (x, y) == pytest.approx((116, 105), abs=0.2)
    assert (w, h, path.frames_unclear) == (SIDE, SIDE, 2)


def test_an_unclear_box_moves_the_path_a_little_unless_its_size_is_another():
    path = moved_path(100, 0.0)
    path.observe_unclear(box(110))
    assert path.predicted == pytest.approx(box(102))
    path.observe_unclear(box(90, side=1.5 * SIDE))
    assert path.predicted == pytest.approx(box(102))


def test_targets_far_from_each_other_are_not_decided():
    paths = [moved_path(50, 0.0), moved_path(200, 0.0)]
    found = [response((box(50), 0.9)), response((box(200), 0.9))]
    assert decisions(paths, found) == [None, None]
    assert decisions(paths, [None, None]) == [None, None]


def test_each_target_takes_the_object_on_its_path():
    """Both trackers prefer the other one's object."""
    paths = [moved_path(100, 3.0), moved_path(120, -3.0)]
    one, other = box(103), box(117)
    found = [response((other, 0.9), (one, 0.8)), response((one, 0.9), (other, 0.8))]
    decided = decisions(paths, found)
    assert [each.index for each in decided] == [1, 1]


def test_of_two_targets_with_one_object_one_is_hidden():
    paths = [moved_path(100, 0.0), moved_path(110, 0.0)]
    found = [response((box(100), 0.9)), response((box(100), 0.7))]
    visible, hidden = decisions(paths, found)
    assert (visible.index, hidden.index) == (0, -1)
    assert hidden.assumed_xywh == pytest.approx(box(110))
    assert not visible.is_clear


def test_more_targets_than_are_tried_jointly():
    paths = [moved_path(100 + 15 * i, 0.0) for i in range(6)]
    found = [response((box(100 + 15 * i), 0.9)) for i in range(6)]
    assert [each.index for each in decisions(paths, found)] == [0] * 6


def test_targets_of_very_different_size_are_not_confused():
    paths = [moved_path(100, 0.0), TargetPath((90.0, 90.0, 60.0, 80.0))]
    found = [response((box(100), 0.9)), response(((90.0, 90.0, 60.0, 80.0), 0.9))]
    assert decisions(paths, found) == [None, None]


def test_an_object_that_was_given_twice_is_tracked_twice():
    first = TargetPath(box(100))
    found = [response((box(100), 0.9)), response((box(100), 0.9))]
    assert decisions([first, TargetPath(box(102), [first])], found) == [None, None]
    assert decisions([TargetPath(box(102), [first]), first], found) == [None, None]
    assert None not in decisions([first, TargetPath(box(112), [first])], found)


def test_a_lost_target_rests():
    path = moved_path(100, 3.0)
    path.rest_at(box(150))
    path.advance(STILL)
    assert path.predicted == pytest.approx(box(150))
    path.observe(box(152))
    assert path.predicted == pytest.approx(box(152))


@pytest.mark.parametrize("aware", [True, False])
def test_identities_of_two_targets_that_cross(aware):
    """Without knowledge of each other, both end on one object."""
    background = np.full((240, 320, 3), (90, 120, 100), np.uint8) // 2 + world(1, SIZE) // 4
    pictures = [world(7, (36, 36))] * 2
    group = ssiam.TrackerGroup(ssiam.load_tracker("lite"), aware=aware)
    for index in range(34):
        boxes = [(80 + 4.0 * index, 100.0, 36.0, 36.0), (212 - 4.0 * index, 108.0, 36.0, 36.0)]
        frame = background.copy()
        for (x, y, w, h), picture in zip(boxes, pictures, strict=True):
            frame[round(y) : round(y + h), round(x) : round(x + w)] = picture
        if index == 0:
            group.init(frame, boxes)
        else:
            tracks = group.update(frame)
    overlaps = [float(iou(track.box, each)) for track, each in zip(tracks, boxes, strict=True)]
    assert (min(overlaps) > 0.5) is aware
