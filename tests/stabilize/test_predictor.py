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


@pytest.mark.parametrize("roll", [0.09, -0.09])
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


@pytest.mark.parametrize("roll", [0.017, -0.017])
def test_a_steady_roll_turns_the_view_by_a_tenth_of_a_radian_at_most(roll):
    """A camera that circles its target: what stands upright must not be tilted."""
    path = [rigid(0, 0, index * roll, frame_center(SIZE)) for index in range(60)]
    boxes = in_frames(path, [BOX] * len(path))
    _, views = run_predictor(TargetPredictor(replace(CONFIG, choose=False), BOX), path, boxes)
    angles = np.array([angle_of(view) for view in views]) / np.sign(roll)
    assert angles.min() == pytest.approx(-0.1)
    assert angles[-1] == pytest.approx(-0.1)


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


STILL = Motion.none(SIZE, reliable=True)
SIDE = np.sqrt(40.0 * 50.0)  # size of BOX


def by(dx, dy=0.0, box=BOX):
    return box[0] + dx, box[1] + dy, *box[2:]


def stepped(config, *steps, motion=STILL):
    """A predictor after frames in which the target moved by (dx, dy) and had a score."""
    predictor, box = TargetPredictor(config, BOX), BOX
    for dx, score in steps:
        predictor.update(motion)
        box = by(dx, box=box)
        predictor.observe(box, score)
    return predictor, box


def test_the_speed_is_a_running_mean():
    config = replace(CONFIG, choose=False, smoothing=0.75)
    predictor, _ = stepped(config, (8.0, 1.0))
    np.testing.assert_allclose(predictor._speeds, [[2, 0], [2, 0]])
    predictor, _ = stepped(config, (8.0, 1.0), (4.0, 1.0))
    np.testing.assert_allclose(predictor._speeds, [[2.5, 0], [2.5, 0]])


def test_the_speed_is_that_in_the_frame_and_in_the_scene():
    config = replace(CONFIG, choose=False)
    predictor = TargetPredictor(config, BOX)
    predictor.update(Motion.from_transform(rigid(10, 4, 0), SIZE))
    predictor.observe(by(6, 2), 1.0)
    np.testing.assert_allclose(predictor._speeds, [[3, 1], [-2, -1]], atol=1e-9)


def test_low_scores_slow_the_target_by_a_tenth():
    config = replace(CONFIG, choose=False)
    for score, speed in ((0.149, 3.6), (0.15, 3.0)):
        predictor, _ = stepped(config, (8.0, 1.0), (2.0, score))
        np.testing.assert_allclose(np.array(predictor._speeds)[:, 0], speed)
    predictor, _ = stepped(replace(config, trust=False), (8.0, 1.0), (2.0, 0.0))
    np.testing.assert_allclose(np.array(predictor._speeds)[:, 0], 3.0)


def test_a_target_in_doubt_for_a_few_frames_moves_on():
    """A skier who tumbles: four frames of low scores, in which the box stays behind."""
    predictor, box = stepped(replace(CONFIG, choose=False), *[(8.0, 1.0)] * 20)
    for _ in range(4):
        predictor.update(STILL)
        predictor.observe(box, 0.05)
    assert predictor.update(STILL)[0] - box[0] == pytest.approx(8 * 0.9**4, rel=0.01)


def test_errors_are_running_means_in_target_sizes():
    predictor = TargetPredictor(CONFIG, BOX)
    np.testing.assert_array_equal(predictor._errors, [0.3, 0.3, 0, 0])
    predictor.update(Motion.from_transform(rigid(10, 0, 0), SIZE))
    predictor.observe(by(4), 1.0)
    still, fixed = 4 / SIDE, 6 / SIDE
    expected = [0.24 + 0.2 * still, 0.24 + 0.2 * still, 0.2 * fixed, 0.2 * fixed]
    np.testing.assert_allclose(predictor._errors, expected)


def test_the_error_is_not_small_before_predictions_were_tested():
    """A camera that follows a fast target: at the start the target is far from the prediction."""
    predictor = TargetPredictor(CONFIG, BOX)
    assert predictor.error == pytest.approx(0.3)
    for _ in range(5):
        predictor.update(STILL)
        predictor.observe(BOX, 1.0)
    assert predictor.error == pytest.approx(0.3 * 0.8**5)
    predictor._errors = [0.05, 0.3, 0.0, 0.2]
    assert predictor.error == pytest.approx(0.05)


def test_errors_of_low_scores_have_half_the_weight():
    predictor = TargetPredictor(CONFIG, BOX)
    predictor.update(STILL)
    predictor.observe(by(SIDE), 0.0)
    memory = np.sqrt(0.8)
    expected = np.array([0.3, 0.3, 0, 0]) * memory + (1 - memory)
    np.testing.assert_allclose(predictor._errors, expected)


def test_errors_are_cut_at_two_target_sizes():
    for sizes, cut in ((1.9, 1.9), (2.5, 2.0), (9.0, 2.0)):
        predictor = TargetPredictor(CONFIG, BOX)
        predictor.update(STILL)
        predictor.observe(by(sizes * SIDE), 1.0)
        np.testing.assert_allclose(predictor._errors[2:], 0.2 * cut)


def test_a_prediction_must_be_better_by_the_margin():
    predictor = TargetPredictor(CONFIG, BOX)
    for fixed, moved in ((0.21, 0.0), (0.19, 10.0)):
        predictor._errors = [0.3, 0.9, fixed, 0.9]
        box = predictor.update(Motion.from_transform(rigid(10, 0, 0), SIZE))
        assert box == pytest.approx(by(moved))
    predictor._errors = [0.3, 0.9, 0.2, 0.9]  # exactly the margin is not enough
    predictor._config = replace(CONFIG, margin=0.3 - 0.2)
    assert predictor._errors[2] + predictor._config.margin >= 0.3
    assert predictor._choice() == 0


def test_the_best_prediction_is_used():
    predictor, box = stepped(CONFIG, (6.0, 1.0))
    motion = Motion.from_transform(rigid(10, 0, 0), SIZE)
    for best, dx in enumerate((0, 3, 10, 13)):
        predictor._errors = [0.5] * 4
        predictor._errors[best] = 0.1
        assert predictor.update(motion) == pytest.approx(by(dx, box=box))


def test_held_frames_keep_box_and_view_in_the_scene():
    predictor, box = stepped(CONFIG, (6.0, 1.0))
    pan = Motion.from_transform(rigid(10, -5, 0.0), SIZE)
    for count in (1, 2, 3):
        predictor.update(pan)
        held = predictor.hold()
        assert held == pytest.approx(by(10 * count, -5 * count, box=box))
        assert predictor.traveled == pytest.approx((3 * count, 0))
        shown = map_box(predictor.stab_from_raw, held)
        assert shown == pytest.approx(box, abs=1e-6)
    predictor.update(Motion.none(SIZE))
    assert predictor.hold() == pytest.approx(by(30, -15, box=box))
    assert predictor.traveled == pytest.approx((12, 0))
    predictor.observe(box, 1.0)
    assert predictor.traveled == (0, 0)


def test_after_held_frames_the_speed_is_per_frame():
    config = replace(CONFIG, choose=False, smoothing=0.0)
    predictor = TargetPredictor(config, BOX)
    for _ in range(3):
        predictor.update(STILL)
        predictor.hold()
    predictor.update(STILL)
    predictor.observe(by(20), 1.0)
    np.testing.assert_allclose(np.array(predictor._speeds)[:, 0], 5)


def test_a_shown_target_returns_by_a_twentieth_and_at_most_a_tenth_of_its_size():
    fixed = replace(CONFIG, choose=False, speed=False)
    for dx, back in ((20.0, 1.0), (-20.0, -1.0), (200.0, 0.1 * SIDE), (-200.0, -0.1 * SIDE)):
        predictor = TargetPredictor(fixed, BOX)
        predictor.update(Motion.from_transform(rigid(dx, 0, 0), SIZE))
        shift = center(map_box(predictor.stab_from_raw, by(dx))) - center(by(dx))
        assert shift == pytest.approx((-dx + back, 0), abs=1e-9)
        predictor = TargetPredictor(fixed, BOX)
        predictor.update(Motion.from_transform(rigid(0, dx, 0), SIZE))
        shift = center(map_box(predictor.stab_from_raw, by(0, dx))) - center(by(0, dx))
        assert shift == pytest.approx((0, -dx + back), abs=1e-9)


def test_the_view_turns_back_by_a_twentieth():
    fixed = replace(CONFIG, choose=False, speed=False)
    predictor = TargetPredictor(fixed, BOX)
    predictor.update(Motion.from_transform(rigid(0, 0, 0.08, center(BOX)), SIZE))
    assert angle_of(predictor.stab_from_raw) == pytest.approx(-0.076)
    predictor.observe(BOX, 1.0)
    predictor.update(STILL)
    assert angle_of(predictor.stab_from_raw) == pytest.approx(-0.076 * 0.95)


@pytest.mark.parametrize(
    ("motion", "is_raw"),
    [
        ((0.0104 * SIDE, 0, 0), True),
        ((0.0107 * SIDE, 0, 0), False),
        ((0, -0.0104 * SIDE, 0), True),
        ((0, -0.0107 * SIDE, 0), False),
        ((0, 0, 0.0104), True),
        ((0, 0, -0.0107), False),
    ],
)
def test_tiny_offsets_are_not_applied(motion, is_raw):
    """Below a hundredth of the target's size, or of a radian, after the return of 5 %."""
    dx, dy, angle = motion
    predictor = TargetPredictor(replace(CONFIG, choose=False), BOX)
    predictor.update(Motion.from_transform(rigid(dx, dy, angle, center(BOX)), SIZE))
    assert np.array_equal(predictor.stab_from_raw, np.eye(3)) is is_raw


def test_a_size_is_the_geometric_mean_of_the_sides():
    assert TargetPredictor(CONFIG, (0.0, 0.0, 20.0, 45.0))._size == pytest.approx(30)


def test_a_chosen_position_in_the_frame_keeps_the_angle_of_the_view():
    """The camera's roll is removed only if its motion is used."""
    predictor = TargetPredictor(CONFIG, BOX)
    roll = Motion.from_transform(rigid(0, 0, 0.1, center(BOX)), SIZE)
    predictor._errors = [0.0, 0.5, 0.5, 0.5]
    predictor.update(roll)
    np.testing.assert_array_equal(predictor.stab_from_raw, np.eye(3))
    predictor.stab_from_raw = rigid(5, 0, 0.08)
    predictor.update(roll)
    assert angle_of(predictor.stab_from_raw) == pytest.approx(0.076)


def test_unreliable_motions_leave_errors_and_speed():
    predictor, box = stepped(CONFIG, (6.0, 1.0))
    errors, speeds = predictor._errors, predictor._speeds
    predictor.update(Motion.none(SIZE))
    predictor.observe(by(50, box=box), 1.0)
    np.testing.assert_array_equal(predictor._errors, errors)
    np.testing.assert_array_equal(predictor._speeds, speeds)


# A ground that tilts: far from the origin it turns otherwise than there.
TILT = Motion(np.array([[1.01, 0.02, 3.0], [-0.01, 0.99, -2.0], [1e-4, -2e-4, 1.0]]), 1, True, SIZE)


def test_the_view_turns_as_the_background_at_the_target_does():
    predictor = TargetPredictor(replace(CONFIG, choose=False), BOX)
    predictor.update(TILT)
    x, y, w, h = BOX
    turned = rigid_parameters(TILT.cur_from_prev, (x + w / 2, y + h / 2))[2]
    angle = rigid_parameters(predictor.stab_from_raw, (0, 0))[2]
    assert angle == pytest.approx(-0.95 * turned)
    assert abs(turned - rigid_parameters(TILT.cur_from_prev, (0, 0))[2]) > 0.01


def test_a_view_that_is_held_over_a_tilting_ground_is_rigid():
    predictor = TargetPredictor(CONFIG, BOX)
    predictor.update(TILT)
    held = predictor.hold()
    view = predictor.stab_from_raw
    np.testing.assert_allclose(view[:2, :2] @ view[:2, :2].T, np.eye(2), atol=1e-12)
    np.testing.assert_array_equal(view[2], [0, 0, 1])
    np.testing.assert_allclose(center(map_box(view, held)), center(BOX), atol=1e-9)
    assert held == pytest.approx(TILT.map_box(BOX)[:2] + BOX[2:], abs=2)


class ArrayPredictor:
    """The hypotheses, errors and speeds of `TargetPredictor` in NumPy."""

    def __init__(self, config, box):
        self.config, self.center, self.size = (
            config,
            np.array(center(box)),
            np.sqrt(box[2] * box[3]),
        )
        self.errors, self.speeds = np.array([0.3, 0.3, 0, 0]), np.zeros((2, 2))

    def update(self, cur_from_prev):
        still, (fixed,) = self.center, map_points(cur_from_prev, [self.center])
        self.positions = np.array([still, still + self.speeds[0], fixed, fixed + self.speeds[1]])
        best = int(np.argmin(self.errors))
        chosen = best if self.errors[best] + self.config.margin < self.errors[0] else 0
        return self.positions[chosen]

    def observe(self, box, score):
        self.center = np.array(center(box))
        errors = np.linalg.norm(self.positions - self.center, axis=1) / self.size
        memory = self.config.memory ** (0.5 if score < 0.15 else 1)
        self.errors = memory * self.errors + (1 - memory) * np.minimum(errors, 2)
        if score < 0.15:
            self.speeds = self.speeds * 0.9
        else:
            moved = self.center - self.positions[[0, 2]]
            self.speeds += (1 - self.config.smoothing) * (moved - self.speeds)
        self.size = np.sqrt(box[2] * box[3])


def test_the_predictions_are_those_of_array_arithmetic():
    random = np.random.default_rng(8)
    predictor, reference, box = TargetPredictor(CONFIG, BOX), ArrayPredictor(CONFIG, BOX), BOX
    for _ in range(200):
        dx, dy, angle = random.normal(0, (9, 6, 0.02))
        cur_from_prev = rigid(dx, dy, angle, (160, 120))
        predicted = predictor.update(Motion.from_transform(cur_from_prev, SIZE))
        expected = reference.update(cur_from_prev)
        np.testing.assert_allclose(center(predicted), expected, rtol=0, atol=1e-9)
        jump, zoom, score = random.normal(0, 4, 2), random.uniform(0.95, 1.05), random.uniform()
        x, y = (random.uniform(0.2, 0.8, 2) * SIZE if score > 0.97 else expected) + jump
        w, h = box[2] * zoom, box[3] * zoom
        box = (float(x - w / 2), float(y - h / 2), w, h)
        predictor.observe(box, score)
        reference.observe(box, score)
        np.testing.assert_allclose(predictor._errors, reference.errors, rtol=0, atol=1e-9)
        np.testing.assert_allclose(predictor._speeds, reference.speeds, rtol=0, atol=1e-9)
