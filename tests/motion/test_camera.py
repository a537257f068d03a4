import numpy as np
import pytest

from ssiam import CameraMotion, FrameSizeError
from ssiam.geometry import map_points, rigid
from synthetic import generator, poses, seen, world

SIZE = (640, 360)
CORNERS = np.array([[0, 0], [640, 0], [640, 360], [0, 360]])
GENERATORS = ["grid", "orb", "gftt", "harris", "brisk", "mser"]


def corner_error(cur_from_prev, truth):
    return np.hypot(*(map_points(cur_from_prev, CORNERS) - map_points(truth, CORNERS)).T).mean()


def shaken(count=6, seed=3, shift=8.0, angle=0.01):
    """Frames under a known white shake, and the true cur_from_prev of each."""
    r = generator(seed)
    steps = r.normal(0, (shift, shift, angle), (count, 3))
    frame_from_world = poses(steps, SIZE)
    frames = [seen(world(), pose) for pose in frame_from_world]
    pairs = zip(frame_from_world[1:], frame_from_world[:-1], strict=True)
    return frames, [np.eye(3)] + [cur @ np.linalg.inv(prev) for cur, prev in pairs]


@pytest.mark.parametrize("keypoints", GENERATORS)
def test_known_shake_is_found(keypoints):
    camera = CameraMotion(keypoints=keypoints)
    for frame, truth in zip(*shaken(), strict=True):
        motion = camera.update(frame)
        assert motion.reliable
        assert corner_error(motion.cur_from_prev, truth) < 0.5


def test_a_jump_beyond_the_reach_of_flow_is_found():
    camera = CameraMotion()
    for frame, truth in zip(*shaken(count=8, shift=25.0, angle=0.02), strict=True):
        motion = camera.update(frame)
        assert motion.reliable
        assert corner_error(motion.cur_from_prev, truth) < 1.0


def test_large_frames_are_worked_on_small_and_answered_large():
    pose = rigid(31.0, -17.0, 0.015, (639.5, 359.5))
    picture = world(size_wh=(1280, 720))
    camera = CameraMotion()
    camera.update(picture)
    corners = 2 * CORNERS
    found = map_points(camera.update(seen(picture, pose)).cur_from_prev, corners)
    assert np.hypot(*(found - map_points(pose, corners)).T).mean() < 0.6


def test_first_frame_is_the_identity():
    motion = CameraMotion().update(world())
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))
    assert motion.reliable


def paste(frame, patch, x, y):
    pasted = frame.copy()
    pasted[y : y + patch.shape[0], x : x + patch.shape[1]] = patch
    return pasted


def test_the_target_is_left_out():
    frames, truths = shaken(shift=3.0, angle=0.004)
    target = world(seed=9)[:240, :400]  # 42 % of the picture, more textured than the rest
    target = np.clip((target.astype(int) - 120) * 3 + 120, 0, 255).astype(np.uint8)
    boxes = [(40 + 12 * t, 30 + 6 * t, 400, 240) for t in range(len(frames))]
    frames = [paste(f, target, *b[:2]) for f, b in zip(frames, boxes, strict=True)]
    camera, blind = CameraMotion(), CameraMotion()
    errors = {"excluded": 0.0, "blind": 0.0}
    for t, frame in enumerate(frames):
        motion = camera.update(frame, exclude=boxes[max(t - 1, 0)])
        errors["excluded"] = max(errors["excluded"], corner_error(motion.cur_from_prev, truths[t]))
        motion = blind.update(frame)
        errors["blind"] = max(errors["blind"], corner_error(motion.cur_from_prev, truths[t]))
    assert errors["excluded"] < 1.0
    assert errors["blind"] > 3.0


def test_several_boxes_are_left_out():
    frames, truths = shaken(count=3)
    camera = CameraMotion()
    for frame, truth in zip(frames, truths, strict=True):
        motion = camera.update(frame, exclude=[(0, 0, 200, 300), (500, 40, 300, 900)])
        assert corner_error(motion.cur_from_prev, truth) < 0.5


NOISE = generator(5).integers(0, 256, (360, 640, 3), dtype=np.uint8)
ODD_FRAMES = {
    "black": np.zeros((360, 640, 3), np.uint8),
    "white": np.full((360, 640, 3), 255, np.uint8),
    "noise": NOISE,
    "cut": world(seed=42),
}


@pytest.mark.parametrize("keypoints", GENERATORS)
@pytest.mark.parametrize("odd", ODD_FRAMES)
def test_frames_that_tell_nothing_are_unreliable(odd, keypoints):
    camera = CameraMotion(keypoints=keypoints)
    frames, _ = shaken(count=3)
    for frame in frames:
        camera.update(frame)
    motion = camera.update(ODD_FRAMES[odd])
    assert not motion.reliable
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))
    camera.update(frames[0])
    assert camera.update(frames[1]).reliable  # and it recovers


def test_least_squares_can_be_chosen():
    camera = CameraMotion(fit="least_squares")
    for frame, truth in zip(*shaken(shift=2.0, angle=0.003), strict=True):
        assert corner_error(camera.update(frame).cur_from_prev, truth) < 1.0


def test_another_size_is_refused():
    camera = CameraMotion()
    camera.update(world())
    with pytest.raises(FrameSizeError, match="320x180 pixels after frames of 640x360"):
        camera.update(world(size_wh=(320, 180)))


def test_unknown_keypoints_are_named():
    with pytest.raises(ValueError, match=r"unknown keypoints 'sift'.*orb"):
        CameraMotion(keypoints="sift")


def test_shift_and_angle_are_told_at_the_centre():
    frames, truths = shaken(count=2)
    camera = CameraMotion()
    camera.update(frames[0])
    motion = camera.update(frames[1])
    centre = map_points(truths[1], [[319.5, 179.5]])[0] - (319.5, 179.5)
    assert motion.shift_angle[:2] == pytest.approx(centre, abs=0.2)


def test_tiny_frames_do_not_raise():
    camera = CameraMotion()
    for seed in range(3):
        motion = camera.update(world(seed, (24, 16)))
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))
