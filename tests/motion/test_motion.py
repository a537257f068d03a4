import cv2
import numpy as np
import pytest

from ssiam import Motion
from ssiam.geometry import map_points, rigid
from ssiam.motion.motion import as_motion

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


def test_the_identity_as_a_motion():
    for reliable, inliers in ((True, 1.0), (False, 0.0)):
        motion = Motion.none(SIZE, reliable=reliable)
        assert (motion.reliable, motion.inliers, motion.size_wh) == (reliable, inliers, SIZE)
        np.testing.assert_array_equal(motion.cur_from_prev, np.eye(3))
    assert not Motion.none(SIZE).reliable


def test_a_transform_is_scaled_to_its_last_number():
    motion = Motion.from_transform(4 * rigid(3, -2, 0.1), SIZE)
    np.testing.assert_allclose(motion.cur_from_prev, rigid(3, -2, 0.1))
    assert (motion.inliers, motion.size_wh) == (1.0, SIZE)
    mirrored = np.diag([-1.0, 1.0, 1.0])
    np.testing.assert_array_equal(Motion.from_transform(mirrored, SIZE).cur_from_prev, mirrored)


def test_a_transform_that_cannot_be_inverted_is_refused():
    for scale, valid in ((0.5, True), (1e-4, False), (1e-5, False)):
        matrix = np.diag([scale, scale, 1.0])
        if valid:
            assert Motion.from_transform(matrix, SIZE).reliable
        else:
            with pytest.raises(ValueError, match="motion"):
                Motion.from_transform(matrix, SIZE)


@pytest.mark.parametrize(
    ("dx", "dy", "angle", "plausible"),
    [
        (192, 0, 0, True),  # 30 % of the longer side
        (192.1, 0, 0, False),
        (0, -192, 0, True),
        (0, -192.1, 0, False),
        (136, 136, 0, False),
        (0, 0, 0.35, True),
        (0, 0, -0.35, True),
        (0, 0, 0.351, False),
        (0, 0, -0.351, False),
    ],
)
def test_how_far_a_camera_can_move(dx, dy, angle, plausible):
    for size in (SIZE, SIZE[::-1]):
        center = (size[0] - 1) / 2, (size[1] - 1) / 2
        motion = Motion.from_transform(rigid(dx, dy, angle - np.sign(angle) * 1e-9, center), size)
        assert motion.is_plausible is plausible


WIDTH = SIZE[0]


@pytest.mark.parametrize(
    ("matrix", "plausible"),
    [
        (np.diag([1.99, 1.99, 1]), True),
        (np.diag([2.01, 2.01, 1]), False),
        (np.diag([0.51, 0.51, 1]), True),
        (np.diag([0.49, 0.49, 1]), False),
        (np.array([[1, 0.6, 0], [0, 1, 0], [0, 0, 1]]), True),
        (np.array([[1, 2, 0], [0, 1, 0], [0, 0, 1]]), False),  # stretched in one direction
        (np.diag([-1.0, 1, 1]), False),  # mirrored
        (np.diag([-1.0, -1, -1]), True),  # the identity
        (np.array([[1, 0, 0], [0, 1, 0], [0.3 / WIDTH, 0, 1]]), True),
        (np.array([[1, 0, 0], [0, 1, 0], [-0.3 / WIDTH, 0, 1]]), False),  # 2.04 times at the right
        (np.array([[1, 0, 0], [0, 1, 0], [-1.5 / WIDTH, 0, 1]]), False),  # the horizon
        (np.full((3, 3), np.nan), False),
    ],
)
def test_how_much_a_camera_can_zoom_and_tilt(matrix, plausible):
    x, y = ((side - 1) / 2 for side in SIZE)
    if not matrix[2, :2].any():
        matrix = rigid(x, y, 0) @ matrix @ rigid(-x, -y, 0)  # around the center of the frame
    assert Motion(matrix, 1.0, True, SIZE).is_plausible is plausible


@pytest.mark.parametrize("focal", [-1, 0, np.inf, np.nan, "500", None])
def test_a_focal_length_is_a_positive_number(focal):
    with pytest.raises(ValueError, match=r"focal_length is .*: give pixels"):
        Motion.from_rotation((0, 0, 0), focal, SIZE)


def test_rotations_are_checked_to_a_thousandth():
    nearly = np.eye(3) * (1 + 4e-4)
    assert Motion.from_rotation(nearly, 0.5, SIZE).reliable
    with pytest.raises(ValueError, match="rotation is"):
        Motion.from_rotation(np.eye(3) * (1 + 6e-4), 500, SIZE)
    for wrong in (np.eye(2), np.eye(4), np.zeros(4), "left"):
        with pytest.raises(ValueError, match="rotation is"):
            Motion.from_rotation(wrong, 500, SIZE)


def test_the_motion_of_a_crop_as_that_of_the_whole_frame():
    crop = Motion(rigid(3, -2, 0.1, (100, 50)), 0.7, True, (200, 100))
    whole = crop.uncropped((30, 20), SIZE)
    np.testing.assert_allclose(whole.cur_from_prev, rigid(3, -2, 0.1, (130, 70)))
    assert (whole.inliers, whole.reliable, whole.size_wh) == (0.7, True, SIZE)
    assert crop.uncropped((0, 0), (200, 100)) is crop
    unknown = Motion.none((200, 100)).uncropped((30, 20), SIZE)
    np.testing.assert_array_equal(unknown.cur_from_prev, np.eye(3))
    assert (unknown.inliers, unknown.reliable, unknown.size_wh) == (0, False, SIZE)


def test_given_motions_are_checked():
    given = Motion.from_transform(rigid(3, -2, 0.1), SIZE)
    assert as_motion(given, SIZE) is given
    converted = as_motion(rigid(3, -2, 0.1), SIZE)
    np.testing.assert_array_equal(converted.cur_from_prev, rigid(3, -2, 0.1))
    assert converted.size_wh == SIZE
    with pytest.raises(ValueError, match=r"size_wh \(640, 360\): give the motion .* 320x180"):
        as_motion(given, (320, 180))
    broken = Motion(np.full((3, 3), np.nan), 1.0, True, SIZE)
    with pytest.raises(ValueError, match="motion is"):
        as_motion(broken, SIZE)
