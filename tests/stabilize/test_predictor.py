"""Where the target will be, from exact motions and exact boxes."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from helpers.camera_walks import (
    BOX,
    SIZE,
    STEP,
    TARGET,
    centre,
    in_raw,
    motions,
    off,
    predicted,
    shaken,
    walking,
)
from ssiam import Motion
from ssiam.geometry import frame_center, map_box, map_points, rigid, rigid_parameters
from ssiam.stabilize import PredictConfig, TargetPredictor

CONFIG = PredictConfig()
SWITCHES = ["choose", "speed", "turn", "trust"]


@pytest.mark.parametrize("off_switch", [None, *SWITCHES])
def test_where_nothing_moves_the_view_is_the_raw_frame(off_switch):
    config = replace(CONFIG, **({off_switch: False} if off_switch else {}))
    still = [np.eye(3)] * 60
    expected, views = predicted(TargetPredictor(config, BOX), still, [BOX] * 60)
    for box, stab_from_raw in zip(expected, views, strict=True):
        np.testing.assert_array_equal(stab_from_raw, np.eye(3))
        assert box == BOX


@pytest.mark.parametrize(
    ("shakes", "scene_step", "raw_step", "known_at", "tolerance"),
    [
        pytest.param(True, (0, 0), None, 5, 0.1, id="fixed in the scene"),
        pytest.param(True, STEP, None, 25, 0.5, id="moving in the scene"),
        pytest.param(True, None, (0, 0), 5, 0.1, id="fixed in the picture"),
        pytest.param(True, None, STEP, 25, 0.5, id="moving in the picture"),
        pytest.param(False, STEP, None, 25, 0.5, id="moving before a still camera"),
    ],
)
def test_each_hypothesis_is_believed_where_it_is_true(
    shakes, scene_step, raw_step, known_at, tolerance
):
    path = shaken() if shakes else [np.eye(3)] * 60
    boxes = walking(raw_step) if raw_step else in_raw(path, walking(scene_step))
    expected, _ = predicted(TargetPredictor(CONFIG, BOX), path, boxes)
    errors = off(expected, boxes)
    assert errors[known_at:].max() < tolerance
    assert np.ptp([box[2:] for box in expected], axis=0) == pytest.approx(0, abs=1e-9)


def test_the_target_is_shown_where_it_was_seen():
    path = shaken()
    boxes = in_raw(path, [BOX] * len(path))
    _, views = predicted(TargetPredictor(CONFIG, BOX), path, boxes)
    shown = [map_points(view, [centre(b)])[0] for view, b in zip(views, boxes[1:], strict=True)]
    steps = np.hypot(*np.diff(shown, axis=0).T)[5:]
    raw_steps = np.hypot(*np.diff([centre(box) for box in boxes], axis=0).T)
    assert steps.max() < 0.05 * TARGET
    assert raw_steps.mean() > 0.2 * TARGET


def test_without_choosing_motion_and_speed_are_always_believed():
    path = shaken()
    still, fixed = [BOX] * len(path), in_raw(path, [BOX] * len(path))
    for boxes, least, most in ((fixed, 0.0, 1e-6), (still, 5.0, 99.0)):
        expected, _ = predicted(TargetPredictor(replace(CONFIG, choose=False), BOX), path, boxes)
        assert least <= off(expected, boxes).mean() < most


def test_without_speed_a_walker_is_expected_where_it_was_in_the_scene():
    path = shaken()
    boxes = in_raw(path, walking(STEP))
    expected, _ = predicted(TargetPredictor(replace(CONFIG, speed=False), BOX), path, boxes)
    for motion, before, box in list(zip(motions(path), boxes, expected, strict=False))[10:]:
        assert box == pytest.approx(map_box(motion.cur_from_prev, before), abs=1e-6)


@pytest.mark.parametrize("trust", [True, False])
def test_boxes_without_trust_tell_no_speed(trust):
    """A tracker that goes astray steadily, and does not believe it itself."""
    still, boxes = [np.eye(3)] * 60, walking(STEP)
    config = replace(CONFIG, trust=trust, choose=False)
    expected, _ = predicted(TargetPredictor(config, BOX), still, boxes, score=0.0)
    wanted = boxes[:-1] if trust else boxes[1:]
    for box, place in list(zip(expected, wanted, strict=True))[30:]:
        assert box == pytest.approx(place, abs=1e-3)


def test_boxes_without_trust_tell_which_prediction_is_best():
    """A camera that goes with a target which its tracker hardly knows again."""
    path, prediction = shaken(), TargetPredictor(CONFIG, BOX)
    predicted(prediction, path, in_raw(path, [BOX] * len(path)))
    expected, _ = predicted(prediction, path, [BOX] * len(path), score=0.0)
    assert expected[30:] == [pytest.approx(BOX, abs=1e-6)] * len(expected[30:])


def test_a_large_margin_is_overcome_by_nothing():
    path = shaken()
    prediction = TargetPredictor(replace(CONFIG, margin=10.0), BOX)
    boxes = in_raw(path, [BOX] * len(path))
    expected, views = predicted(prediction, path, boxes)
    assert expected[30:] == boxes[30:-1]
    np.testing.assert_array_equal(views[30:], [views[30]] * len(views[30:]))


def test_frames_whose_motion_is_not_known_tell_nothing():
    path = shaken()
    boxes = in_raw(path, [BOX] * len(path))
    prediction = TargetPredictor(CONFIG, BOX)
    predicted(prediction, path, boxes)
    for _ in range(200):  # here "where it was" is as good as the camera's motion
        assert prediction.update(Motion.none(SIZE)) == pytest.approx(boxes[-1], abs=1e-6)
        prediction.observe(boxes[-1], 1.0)
    motion = Motion.from_transform(rigid(12, -9, 0.01), SIZE)
    fixed = map_box(motion.cur_from_prev, boxes[-1])
    assert prediction.update(motion) == pytest.approx(fixed, abs=0.1)


def test_after_a_move_nothing_is_known_of_the_speed():
    prediction = TargetPredictor(replace(CONFIG, choose=False), BOX)
    predicted(prediction, [np.eye(3)] * 30, walking(STEP, 30))
    motion = Motion.from_transform(rigid(4, 3, 0.0), SIZE)
    prediction.move_to((100.0, 100.0, 30.0, 30.0))
    assert prediction.update(motion) == pytest.approx((104, 103, 30, 30))


def angle_of(stab_from_raw):
    return rigid_parameters(stab_from_raw, frame_center(SIZE))[2]


@pytest.mark.parametrize("roll", [0.2, -0.2])
@pytest.mark.parametrize("turn", [True, False])
def test_a_roll_is_turned_back_and_the_view_comes_upright(roll, turn):
    path = shaken(200, angle=0.0)
    path[30:] = [rigid(0, 0, roll, frame_center(SIZE)) @ pose for pose in path[30:]]
    boxes = in_raw(path, [BOX] * len(path))
    expected, views = predicted(TargetPredictor(replace(CONFIG, turn=turn), BOX), path, boxes)
    angles = np.array([angle_of(view) for view in views]) / roll
    if not turn:
        np.testing.assert_allclose(angles, 0, atol=1e-9)
        return
    assert -1 <= angles[29] < -0.8  # the frame of the roll
    assert (np.diff(angles[29:]) > 0).all()
    assert abs(angles[-1]) < 0.05
    assert off(expected, boxes)[5:].max() < 0.1  # the turn is about the target


def test_the_view_stays_near_the_raw_frame_under_shake():
    path = shaken(1500)
    boxes = in_raw(path, [BOX] * len(path))
    _, views = predicted(TargetPredictor(CONFIG, BOX), path, boxes)
    for view, box in zip(views, boxes[1:], strict=True):
        assert np.hypot(*(map_points(view, [centre(box)])[0] - centre(box))) < 60  # 5 sigma
        assert abs(angle_of(view)) < 0.1


def test_the_view_does_not_wander_off_for_ever():
    """Fast to the left, slowly back: the target comes back in the raw frame, and in the view."""
    steps = np.tile([*[-8.0] * 30, *[3.0] * 80], 10)
    path = [rigid(dx, 0, 0) for dx in np.cumsum([0, *steps])]
    boxes = in_raw(path, [BOX] * len(path))
    _, views = predicted(TargetPredictor(CONFIG, BOX), path, boxes)
    for view, box in zip(views, boxes[1:], strict=True):
        assert abs(map_points(view, [centre(box)])[0, 0] - centre(box)[0]) < SIZE[0]


def test_the_state_does_not_grow():
    prediction, sizes = TargetPredictor(CONFIG, BOX), []
    path = shaken(5001)
    for count in (100, 4900):
        part, path = path[: count + 1], path[count:]
        predicted(prediction, part, in_raw(part, [BOX] * len(part)))
        sizes.append(len(pickle.dumps(prediction)))
    assert sizes[0] == sizes[1]
