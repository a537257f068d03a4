import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from helpers.synthetic import generator, poses
from ssiam import Motion, Stabilizer, StabilizerConfig
from ssiam.errors import ArgumentError
from ssiam.geometry import frame_center, map_box, map_points, rigid, rigid_parameters
from ssiam.stabilize import CameraPath, PaperConfig
from ssiam.stabilize.judge import ShakeJudge
from ssiam.stabilize.stabilizer import _clamped, _exclusive, _nested

SIZE = (640, 360)
CENTER = frame_center(SIZE)
UNLIMITED = StabilizerConfig().with_options(gate=0, thx1=1e6, thy1=1e6, thx2=1e6, thy2=1e6, tha=10)


def motions(frame_from_world):
    """The exact motion to every frame."""
    previous = [frame_from_world[0], *frame_from_world[:-1]]
    for cur, prev in zip(frame_from_world, previous, strict=True):
        yield Motion(cur @ np.linalg.inv(prev), 1.0, True, SIZE)


def hand_held(count=120, seed=4, roll=0.01, pan=0.0):
    r = generator(seed)
    steps = r.normal(0, (4, 3, roll), (count, 3))
    steps[:, 0] += pan * np.arange(count)
    return poses(steps, SIZE)


@pytest.mark.parametrize("point", [(320.0, 180.0), (40.0, 30.0), (610.0, 350.0)])
@pytest.mark.parametrize("pan", [0.0, 2.0])
def test_a_background_point_is_on_the_smoothed_path(point, pan):
    frame_from_world = hand_held(pan=pan)
    stabilizer = Stabilizer(UNLIMITED)
    raw_path = np.array([map_points(pose, [point])[0] for pose in frame_from_world])
    for t, motion in enumerate(motions(frame_from_world)):
        stab_from_raw = stabilizer.update(motion)
        smoothed = raw_path[max(0, t - 29) : t + 1].mean(axis=0)
        stabilized = map_points(stab_from_raw, [raw_path[t]])[0]
        assert np.hypot(*(stabilized - smoothed)) < 0.1


def test_the_printed_equation_5_adds_the_shake_of_a_frame():
    paper, literal = Stabilizer(UNLIMITED), Stabilizer(replace(UNLIMITED, stabilize="literal"))
    for motion in motions(hand_held(roll=0.0)):
        difference = literal.update(motion)[:2, 2] - paper.update(motion)[:2, 2]
        np.testing.assert_allclose(difference, motion.shift_angle[:2], atol=1e-9)


def corrections(steps, **limits):
    """(dx, dy, angle) of every stabilized frame, for camera poses (dx, dy, angle)."""
    stabilizer = Stabilizer(UNLIMITED.with_options(**limits))
    return np.array(
        [
            rigid_parameters(stabilizer.update(motion), CENTER)
            for motion in motions(poses(steps, SIZE))
        ]
    )


def jump(dx=0.0, dy=0.0, angle=0.0):
    """A camera that is still for 60 frames, and then jumps."""
    steps = np.zeros((80, 3))
    steps[60:] = dx, dy, angle
    return steps


@pytest.mark.parametrize("sign", [1, -1])
def test_equation_6_limits_the_shift_with_its_sign(sign):
    found = corrections(jump(dx=sign * 300, dy=sign * 200), thx1=60, thy1=30)
    assert found[60, 0] == pytest.approx(-sign * 80)  # N + THx1
    assert found[60, 1] == pytest.approx(-sign * 50)  # N + THy1


@pytest.mark.parametrize("sign", [1, -1])
def test_equation_6_limits_the_change_per_frame(sign):
    found = corrections(jump(dx=sign * 300, dy=sign * 200), thx2=20, thy2=10)
    np.testing.assert_allclose(found[59:63, 0], -sign * np.array([0, 20, 40, 60]), atol=1e-9)
    np.testing.assert_allclose(found[59:63, 1], -sign * np.array([0, 10, 20, 30]), atol=1e-9)


@pytest.mark.parametrize("sign", [1, -1])
def test_equation_6_limits_the_rotation(sign):
    found = corrections(jump(angle=sign * 0.4), tha=0.3)
    assert found[60, 2] == pytest.approx(-sign * 0.3)
    assert corrections(jump(angle=sign * 0.2), tha=0.3)[60, 2] == pytest.approx(
        -sign * 0.2 * 29 / 30
    )


def test_the_gate_skips_nearly_still_frames():
    small, large = jump(dx=0.05), jump(dx=5.0)
    assert not corrections(small, gate=0.1)[60:].any()
    assert corrections(large, gate=0.1)[60, 0] == pytest.approx(-5 * 29 / 30)
    assert corrections(small, gate=0.0)[60, 0] != 0


def test_a_constant_pan_lags_and_saturates():
    pan = np.zeros((120, 3))
    pan[:, 0] = 8.0 * np.arange(120)
    found = corrections(pan, thx1=60)
    assert found[100, 0] == pytest.approx(-80)  # a limitation of the paper's method
    pan[:, 0] /= 4
    assert corrections(pan, thx1=60)[100, 0] == pytest.approx(-2.0 * 14.5)


def test_unreliable_motion_keeps_the_view():
    stabilizer = Stabilizer(StabilizerConfig())
    for motion in motions(hand_held(count=40)):
        before = stabilizer.update(motion)
    for _ in range(50):
        held = stabilizer.update(Motion.none(SIZE))
        np.testing.assert_array_equal(held, before)


def test_off_returns_the_identity():
    stabilizer = Stabilizer(StabilizerConfig("off"))
    for motion in motions(hand_held(count=40)):
        np.testing.assert_array_equal(stabilizer.update(motion), np.eye(3))


def test_boxes_are_mapped_back_by_the_inverse():
    stabilizer = Stabilizer(StabilizerConfig())
    box = (301.5, 122.25, 40.0, 61.5)
    for motion in motions(hand_held(count=60)):
        stab_from_raw = stabilizer.update(motion)
        raw_from_stab = np.linalg.inv(stab_from_raw)
        mapped_back = map_box(raw_from_stab, map_box(stab_from_raw, box))
        assert mapped_back == pytest.approx(box, abs=1e-9)


def test_memory_does_not_grow_with_the_stream():
    """The state has the same size and values at frame 20,000 as at frame 100."""
    path = CameraPath(30)
    sway = poses([(3, 1, 0.01), (0, 0, 0)], SIZE)
    one, other = list(motions([*sway, sway[0]]))[1:]
    tracemalloc.start()
    for t in range(20_000):
        path.advance(one if t % 2 else other)
        if t == 101:
            early, used_early = path.difference(), tracemalloc.get_traced_memory()[0]
    used_late = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert used_late <= used_early + 10_000  # a byte a frame would be 20,000
    np.testing.assert_allclose(path.difference(), early, atol=1e-9)


def test_an_empty_path_has_no_difference():
    assert CameraPath(30).difference() == (0, 0, 0)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_gate_is_the_largest_displacement_of_a_corner(sign):
    """That of the shift, and of the rotation at half of the diagonal."""
    size = (60, 80)  # half of the diagonal is 50 px
    config = StabilizerConfig("paper").with_options(gate=10.0, window=2)
    for dx, dy, angle, moved in (
        (12.0, 16.0, 0.0, True),  # smoothed: half of it, 10 px
        (11.9, 16.0, 0.0, False),
        (-12.0, 16.0, 0.0, True),
        (0.0, 0.0, 0.401, True),
        (0.0, 0.0, 0.399, False),
        (6.0, 8.0, 0.201, True),
        (6.0, 8.0, 0.199, False),
    ):
        stabilizer = Stabilizer(config)
        stabilizer.update(Motion.none(size, reliable=True))
        motion = Motion.from_transform(rigid(dx, dy, sign * angle, frame_center(size)), size)
        found = stabilizer.update(motion)
        assert np.array_equal(found, np.eye(3)) != moved
        assert stabilizer.shakes is moved


def test_after_a_gated_frame_the_change_is_from_zero():
    """The limits of the change are relative to the last applied correction."""
    stabilizer = Stabilizer(UNLIMITED.with_options(gate=5.0, thx2=3.0, window=2))
    stabilizer.update(Motion.none(SIZE, reliable=True))
    shifts = []
    for dx in (20.0, 4.0, 20.0, 20.0):
        motion = Motion.from_transform(rigid(dx, 0, 0), SIZE)
        shifts.append(stabilizer.update(motion)[0, 2])
    assert shifts == pytest.approx([-3, 0, -3, -6])


def test_limits_of_numbers():
    assert _clamped(5.0, 1.0, 3.0) == 4
    assert _clamped(-5.0, 1.0, 3.0) == -2
    assert _clamped(2.0, 1.0, 3.0) == 2
    assert _nested(9.0, 6.0, 1.0, 2.0) == 3
    assert _nested(9.0, 6.0, 5.0, 2.0) == 6
    assert _nested(-9.0, 6.0, -5.0, 2.0) == -6
    assert _exclusive(9.0, 6.0, 1.0, 2.0) == 6
    assert _exclusive(-9.0, 6.0, 1.0, 2.0) == -6
    assert _exclusive(6.0, 6.0, 1.0, 2.0) == 3


def test_the_judge_of_the_window_forgets_older_frames():
    judge = ShakeJudge(PaperConfig(judge="window", window=3, shake=2.0))
    still, moved = (0.0, 0.0, 0.5), (3.0, -4.0, 0.0)
    answers = [judge.shakes((9.0, 9.0, 9.0), each, SIZE) for each in (still, moved, still, still)]
    assert answers == [False, True, True, True]  # roots of 25 / 2 and 25 / 3
    assert not judge.shakes((9.0, 9.0, 9.0), still, SIZE)
    assert judge.answer is False
    exact = ShakeJudge(PaperConfig(judge="window", window=3, shake=5.0))
    assert exact.shakes((0.0, 0.0, 0.0), moved, SIZE)


def test_a_path_averages_its_window():
    path = CameraPath(3)
    assert not path.started
    for dx in (0.0, 6.0, 3.0, 9.0):
        path.advance(Motion.from_transform(rigid(dx, -dx, 0.0), SIZE))
    assert path.started
    assert path.difference() == pytest.approx(((-12 - 9 + 0) / 3, 7, 0))
    path = CameraPath(2)
    for angle in (0.0, 0.2):
        path.advance(Motion.from_transform(rigid(0, 0, angle, CENTER), SIZE))
    assert path.difference() == pytest.approx((0, 0, -0.1), abs=1e-9)


def test_other_arguments_are_refused():
    with pytest.raises(ArgumentError, match="config is 'paper': give a StabilizerConfig"):
        Stabilizer("paper")
    with pytest.raises(ArgumentError, match=r"motion is .* give a Motion"):
        Stabilizer(StabilizerConfig("paper")).update(np.eye(3))


def test_the_path_of_tilted_frames_is_that_of_the_mapped_center():
    """A homography: the past position is divided by its weight."""
    tilt = np.array([[1.0, 0.01, 4], [0, 1.02, -3], [2e-4, -1e-4, 1]])
    path = CameraPath(2)
    path.advance(Motion.none(SIZE, reliable=True))
    path.advance(Motion.from_transform(tilt, SIZE))
    (x, y), (u, v) = CENTER, map_points(np.linalg.inv(tilt), [CENTER])[0]
    assert path.difference()[:2] == pytest.approx(((u - x) / 2, (v - y) / 2))


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e308, 1e9])
def test_motions_that_no_camera_makes(number):
    """NaN stayed in the path for the rest of the stream."""
    stabilizer = Stabilizer(UNLIMITED)
    matrix = np.eye(3)
    matrix[0, 2] = number
    with pytest.raises(ArgumentError, match="motion"):
        stabilizer.update(Motion(matrix, 1.0, True, SIZE))
    np.testing.assert_array_equal(stabilizer.update(Motion.none(SIZE, reliable=True)), np.eye(3))
