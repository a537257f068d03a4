import cv2
import numpy as np
import pytest

from ssiam import Motion
from ssiam.geometry import map_points, rigid

SIZE = (640, 360)


def test_a_transform_is_used_unchanged():
    motion = Motion.from_transform(rigid(3, -2, 0.1)[:2], SIZE)
    np.testing.assert_array_equal(motion.cur_from_prev, rigid(3, -2, 0.1))
    assert motion.reliable


@pytest.mark.parametrize(
    "matrix", [np.zeros((3, 3)), np.full((3, 3), np.nan), np.eye(4), [1.0, 2.0], np.ones((2, 3))]
)
def test_invalid_transforms_are_refused(matrix):
    with pytest.raises(ValueError, match=r"motion is .*transform of pixels"):
        Motion.from_transform(matrix, SIZE)


def test_a_pan_to_the_right_moves_the_scene_to_the_left():
    focal, pan = 500.0, 0.02
    motion = Motion.from_rotation((0.0, -pan, 0.0), focal, SIZE)
    dx, dy, angle = motion.shift_angle
    assert (dx, dy, angle) == pytest.approx((-focal * np.tan(pan), 0, 0), abs=1e-9)


def test_a_roll_is_a_rotation_about_the_principal_point():
    motion = Motion.from_rotation((0.0, 0.0, 0.03), 700.0, SIZE, principal_xy=(300.0, 190.0))
    np.testing.assert_allclose(motion.cur_from_prev, rigid(0, 0, 0.03, (300, 190)), atol=1e-9)


def test_points_of_the_scene_follow_a_rotation():
    rotation, _ = cv2.Rodrigues(np.array([0.03, -0.05, 0.08]))
    camera = np.array([[600, 0, 319.5], [0, 600, 179.5], [0, 0, 1]])
    points = np.array([[0.2, -0.1, 1.0], [-0.4, 0.2, 1.0], [0.3, 0.15, 1.0]])
    prev, cur = ((camera @ xyz.T).T for xyz in (points, points @ rotation.T))
    motion = Motion.from_rotation(rotation, 600, SIZE)
    found = map_points(motion.cur_from_prev, prev[:, :2] / prev[:, 2:])
    np.testing.assert_allclose(found, cur[:, :2] / cur[:, 2:], atol=1e-9)


@pytest.mark.parametrize(
    ("rotation", "focal", "message"),
    {
        "not a rotation": (np.ones((3, 3)), 500, "rotation is"),
        "not finite": ((0, np.nan, 0), 500, "rotation is"),
        "no focal length": ((0, 0, 0), 0, "focal_length is 0"),
    }.values(),
)
def test_invalid_rotations_are_refused(rotation, focal, message):
    with pytest.raises(ValueError, match=message):
        Motion.from_rotation(rotation, focal, SIZE)
