import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam import CameraMotion, FrameSizeError, Motion
from ssiam.geometry import map_points, rigid

SIZE = (640, 360)
CORNERS = np.array([[0, 0], [640, 0], [640, 360], [0, 360]])
GENERATORS = ["direct", "orb", "gftt", "harris", "brisk", "mser"]


def corner_error(cur_from_prev, truth):
    return np.hypot(*(map_points(cur_from_prev, CORNERS) - map_points(truth, CORNERS)).T).mean()


def shaken(count=6, seed=3, shift=8.0, angle=0.01):
    """Frames with a known white shake, and the true cur_from_prev of each."""
    r = generator(seed)
    steps = r.normal(0, (shift, shift, angle), (count, 3))
    frame_from_world = poses(steps, SIZE)
    frames = [camera_frame(world(), pose) for pose in frame_from_world]
    pairs = zip(frame_from_world[1:], frame_from_world[:-1], strict=True)
    return frames, [np.eye(3)] + [cur @ np.linalg.inv(prev) for cur, prev in pairs]


@pytest.mark.parametrize("keypoints", GENERATORS)
def test_a_known_shake_is_estimated(keypoints):
    camera = CameraMotion(keypoints=keypoints)
    for frame, truth in zip(*shaken(), strict=True):
        motion = camera.update(frame)
        assert motion.reliable
        assert corner_error(motion.cur_from_prev, truth) < 0.5


def test_the_motion_of_the_first_frame_is_the_identity():
    motion = CameraMotion().update(world())
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))
    assert motion.reliable


def test_several_boxes_can_be_excluded():
    frames, truths = shaken(count=3)
    camera = CameraMotion()
    for frame, truth in zip(frames, truths, strict=True):
        motion = camera.update(frame, exclude=[(0, 0, 200, 300), (500, 40, 300, 900)])
        assert corner_error(motion.cur_from_prev, truth) < 0.5


NOISE = generator(5).integers(0, 256, (360, 640, 3), dtype=np.uint8)
UNUSABLE_FRAMES = {
    "black": np.zeros((360, 640, 3), np.uint8),
    "white": np.full((360, 640, 3), 255, np.uint8),
    "noise": NOISE,
    "cut": world(seed=42),
}


@pytest.mark.parametrize("keypoints", GENERATORS)
@pytest.mark.parametrize("kind", UNUSABLE_FRAMES)
def test_unusable_frames_are_unreliable(kind, keypoints):
    camera = CameraMotion(keypoints=keypoints)
    frames, _ = shaken(count=3)
    for frame in frames:
        camera.update(frame)
    motion = camera.update(UNUSABLE_FRAMES[kind])
    assert not motion.reliable
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))
    camera.update(frames[0])
    assert camera.update(frames[1]).reliable  # and the camera recovers


def test_least_squares_fit():
    camera = CameraMotion("orb", fit="least_squares")
    for frame, truth in zip(*shaken(shift=2.0, angle=0.003), strict=True):
        assert corner_error(camera.update(frame).cur_from_prev, truth) < 1.0


def test_a_change_of_size_is_refused():
    camera = CameraMotion()
    camera.update(world())
    with pytest.raises(FrameSizeError, match="320x180 pixels after frames of 640x360"):
        camera.update(world(size_wh=(320, 180)))


@pytest.mark.parametrize(
    ("settings", "message"),
    {
        "keypoints": ({"keypoints": "sift"}, r"unknown keypoints 'sift'.*orb"),
        "fit": ({"fit": "magic"}, r"unknown fit 'magic'.*least_squares"),
        "model": ({"model": "magic"}, r"unknown model 'magic'.*homography"),
    }.values(),
)
def test_unknown_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        CameraMotion(**settings)


@pytest.mark.parametrize("exclude", [(1, 2, 3), (0, 0, float("nan"), 4), "12"])
def test_invalid_boxes_are_refused(exclude):
    camera = CameraMotion()
    with pytest.raises(ValueError, match=r"exclude is .*\(x, y, w, h\)"):
        camera.update(world(), exclude=exclude)


def test_the_shift_is_that_of_the_frame_center():
    frames, truths = shaken(count=2)
    camera = CameraMotion()
    camera.update(frames[0])
    motion = camera.update(frames[1])
    center = map_points(truths[1], [[319.5, 179.5]])[0] - (319.5, 179.5)
    assert motion.shift_angle[:2] == pytest.approx(center, abs=0.2)


@pytest.mark.parametrize("size_wh", [(24, 16), (1, 1), (700, 3), (5, 400)])
def test_tiny_frames_are_accepted(size_wh):
    camera = CameraMotion()
    for seed in range(3):
        motion = camera.update(generator(seed).integers(0, 256, (*size_wh[::-1], 3), np.uint8))
    np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))


def test_a_given_motion_replaces_the_estimate():
    frames, truths = shaken(count=4)
    camera = CameraMotion()
    camera.update(frames[0])
    given = camera.update(frames[1], motion=rigid(7, 8, 0.1)[:2])
    np.testing.assert_allclose(given.cur_from_prev, rigid(7, 8, 0.1))
    motion = camera.update(frames[2])  # estimated again, from the frame before
    assert corner_error(motion.cur_from_prev, truths[2]) < 0.5
    same = Motion.from_transform(np.eye(3), SIZE)
    assert camera.update(frames[3], motion=same) is same
