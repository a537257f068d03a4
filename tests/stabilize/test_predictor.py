"""Predicted target positions from exact camera motions and boxes."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from helpers.camera_paths import (
    BOX,
    SIZE,
    STEP,
    TARGET,
    center,
    center_errors,
    in_frames,
    motions,
    run_predictor,
    shaken,
    walking,
)
from ssiam import Motion
from ssiam.geometry import frame_center, map_box, map_points, rigid, rigid_parameters
from ssiam.stabilize import PredictConfig, TargetPredictor

CONFIG = PredictConfig()
SWITCHES = ["choose", "speed", "turn", "trust"]


@pytest.mark.parametrize("disabled", [None, *SWITCHES])
def test_without_motion_the_view_is_the_raw_frame(disabled):
    config = replace(CONFIG, **({disabled: False} if disabled else {}))
    still = [np.eye(3)] * 60
    expected, views = run_predictor(TargetPredictor(config, BOX), still, [BOX] * 60)
    for box, stab_from_raw in zip(expected, views, strict=True):
        np.testing.assert_array_equal(stab_from_raw, np.eye(3))
        assert box == BOX


@pytest.mark.parametrize(
    ("shakes", "scene_step", "raw_step", "settled_at", "tolerance"),
    [
        pytest.param(True, (0, 0), None, 5, 0.1, id="fixed in the scene"),
        pytest.param(True, STEP, None, 25, 0.5, id="moving in the scene"),
        pytest.param(True, None, (0, 0), 5, 0.1, id="fixed in the frame"),
        pytest.param(True, None, STEP, 25, 0.5, id="moving in the frame"),
        pytest.param(False, STEP, None, 25, 0.5, id="moving, still camera"),
    ],
)
def test_the_correct_hypothesis_is_chosen(shakes, scene_step, raw_step, settled_at, tolerance):
    path = shaken() if shakes else [np.eye(3)] * 60
    boxes = walking(raw_step) if raw_step else in_frames(path, walking(scene_step))
    expected, _ = run_predictor(TargetPredictor(CONFIG, BOX), path, boxes)
    errors = center_errors(expected, boxes)
    assert errors[settled_at:].max() < tolerance
    assert np.ptp([box[2:] for box in expected], axis=0) == pytest.approx(0, abs=1e-9)


def test_the_view_shows_the_target_at_its_last_position():
    path = shaken()
    boxes = in_frames(path, [BOX] * len(path))
    _, views = run_predictor(TargetPredictor(CONFIG, BOX), path, boxes)
    positions = [map_points(view, [center(b)])[0] for view, b in zip(views, boxes[1:], strict=True)]
    steps = np.hypot(*np.diff(positions, axis=0).T)[5:]
    raw_steps = np.hypot(*np.diff([center(box) for box in boxes], axis=0).T)
    assert steps.max() < 0.05 * TARGET
    assert raw_steps.mean() > 0.2 * TARGET


def test_without_choice_motion_and_speed_are_always_applied():
    path = shaken()
    still, fixed = [BOX] * len(path), in_frames(path, [BOX] * len(path))
    for boxes, least, most in ((fixed, 0.0, 1e-6), (still, 5.0, 99.0)):
        expected, _ = run_predictor(
            TargetPredictor(replace(CONFIG, choose=False), BOX), path, boxes
        )
        assert least <= center_errors(expected, boxes).mean() < most


def test_without_speed_the_prediction_is_fixed_in_the_scene():
    path = shaken()
    boxes = in_frames(path, walking(STEP))
    expected, _ = run_predictor(TargetPredictor(replace(CONFIG, speed=False), BOX), path, boxes)
    for motion, before, box in list(zip(motions(path), boxes, expected, strict=False))[10:]:
        assert box == pytest.approx(map_box(motion.cur_from_prev, before), abs=1e-6)


@pytest.mark.parametrize("trust", [True, False])
def test_low_score_boxes_do_not_set_the_speed(trust):
    """A tracker that drifts at constant speed, with a score of 0."""
    still, boxes = [np.eye(3)] * 60, walking(STEP)
    config = replace(CONFIG, trust=trust, choose=False)
    expected, _ = run_predictor(TargetPredictor(config, BOX), still, boxes, score=0.0)
    wanted = boxes[:-1] if trust else boxes[1:]
    for box, wanted_box in list(zip(expected, wanted, strict=True))[30:]:
        assert box == pytest.approx(wanted_box, abs=1e-3)


def test_low_score_boxes_select_the_prediction():
    """A camera that follows a target with low scores."""
    path, predictor = shaken(), TargetPredictor(CONFIG, BOX)
    run_predictor(predictor, path, in_frames(path, [BOX] * len(path)))
    expected, _ = run_predictor(predictor, path, [BOX] * len(path), score=0.0)
    assert expected[30:] == [pytest.approx(BOX, abs=1e-6)] * len(expected[30:])


def test_a_large_margin_disables_the_other_hypotheses():
    path = shaken()
    predictor = TargetPredictor(replace(CONFIG, margin=10.0), BOX)
    boxes = in_frames(path, [BOX] * len(path))
    expected, views = run_predictor(predictor, path, boxes)
    assert expected[30:] == boxes[30:-1]
    np.testing.assert_array_equal(views[30:], [views[30]] * len(views[30:]))


def test_frames_without_reliable_motion_do_not_update_the_errors():
    path = shaken()
    boxes = in_frames(path, [BOX] * len(path))
    predictor = TargetPredictor(CONFIG, BOX)
    run_predictor(predictor, path, boxes)
    for _ in range(200):  # "still" has the same error here as "fixed"
        assert predictor.update(Motion.none(SIZE)) == pytest.approx(boxes[-1], abs=1e-6)
        predictor.observe(boxes[-1], 1.0)
    motion = Motion.from_transform(rigid(12, -9, 0.01), SIZE)
    fixed = map_box(motion.cur_from_prev, boxes[-1])
    assert predictor.update(motion) == pytest.approx(fixed, abs=0.1)


def test_move_to_resets_the_speed():
    predictor = TargetPredictor(replace(CONFIG, choose=False), BOX)
    run_predictor(predictor, [np.eye(3)] * 30, walking(STEP, 30))
    motion = Motion.from_transform(rigid(4, 3, 0.0), SIZE)
    predictor.move_to((100.0, 100.0, 30.0, 30.0))
    assert predictor.update(motion) == pytest.approx((104, 103, 30, 30))


def angle_of(stab_from_raw):
    return rigid_parameters(stab_from_raw, frame_center(SIZE))[2]


@pytest.mark.parametrize("roll", [0.2, -0.2])
@pytest.mark.parametrize("turn", [True, False])
def test_a_roll_is_compensated_and_the_view_returns_to_upright(roll, turn):
    path = shaken(200, angle=0.0)
    path[30:] = [rigid(0, 0, roll, frame_center(SIZE)) @ pose for pose in path[30:]]
    boxes = in_frames(path, [BOX] * len(path))
    expected, views = run_predictor(TargetPredictor(replace(CONFIG, turn=turn), BOX), path, boxes)
    angles = np.array([angle_of(view) for view in views]) / roll
    if not turn:
        np.testing.assert_allclose(angles, 0, atol=1e-9)
        return
    assert -1 <= angles[29] < -0.8  # the frame of the roll
    assert (np.diff(angles[29:]) > 0).all()
    assert abs(angles[-1]) < 0.05
    assert center_errors(expected, boxes)[5:].max() < 0.1  # the rotation is about the target


def test_the_view_stays_near_the_raw_frame_under_shake():
    path = shaken(1500)
    boxes = in_frames(path, [BOX] * len(path))
    _, views = run_predictor(TargetPredictor(CONFIG, BOX), path, boxes)
    for view, box in zip(views, boxes[1:], strict=True):
        assert np.hypot(*(map_points(view, [center(box)])[0] - center(box))) < 60  # 5 sigma
        assert abs(angle_of(view)) < 0.1


def test_the_view_does_not_drift_away():
    """Fast to the left, slowly back: the view stays within a frame width of the raw frame."""
    steps = np.tile([*[-8.0] * 30, *[3.0] * 80], 10)
    path = [rigid(dx, 0, 0) for dx in np.cumsum([0, *steps])]
    boxes = in_frames(path, [BOX] * len(path))
    _, views = run_predictor(TargetPredictor(CONFIG, BOX), path, boxes)
    for view, box in zip(views, boxes[1:], strict=True):
        assert abs(map_points(view, [center(box)])[0, 0] - center(box)[0]) < SIZE[0]


def test_the_size_of_the_state_is_constant():
    predictor, sizes = TargetPredictor(CONFIG, BOX), []
    path = shaken(5001)
    for count in (100, 4900):
        part, path = path[: count + 1], path[count:]
        run_predictor(predictor, part, in_frames(part, [BOX] * len(part)))
        sizes.append(len(pickle.dumps(predictor)))
    assert sizes[0] == sizes[1]


def test_observe_and_hold_without_an_update_only_set_or_return_the_box():
    predictor = TargetPredictor(CONFIG, BOX)
    assert predictor.hold() == BOX
    assert predictor.traveled == (0, 0)
    moved = (10.0, 20.0, 30.0, 40.0)
    predictor.observe(moved, 1.0)
    predictor.observe(moved, 1.0)
    assert predictor.hold() == moved
    fresh = TargetPredictor(CONFIG, moved)
    motion = Motion.from_transform(rigid(12, -9, 0.01), SIZE)
    assert predictor.update(motion) == fresh.update(motion)
    np.testing.assert_array_equal(predictor.stab_from_raw, fresh.stab_from_raw)
