import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ssiam import geometry as g

angles = st.floats(-0.5, 0.5)
shifts = st.floats(-200, 200)
sides = st.floats(1, 300)


@given(shifts, shifts, angles, shifts, shifts, sides, sides)
def test_a_box_is_mapped_back_by_the_inverse(dx, dy, angle, x, y, w, h):
    stab_from_raw = g.rigid(dx, dy, angle, (320, 180))
    mapped = g.map_box(stab_from_raw, (x, y, w, h))
    back = g.map_box(np.linalg.inv(stab_from_raw), mapped)
    assert back == pytest.approx((x, y, w, h), abs=1e-9)


def test_a_box_is_mapped_back_by_the_inverse_homography():
    cur_from_prev = np.array([[1.1, 0.05, 12], [-0.04, 0.95, -7], [2e-4, -1e-4, 1]])
    box = (100.0, 80.0, 40.0, 60.0)
    back = g.map_box(np.linalg.inv(cur_from_prev), g.map_box(cur_from_prev, box))
    assert back == pytest.approx(box, abs=1e-9)


def test_box_sides_are_scaled_by_the_zoom():
    assert g.map_box(np.diag([2.0, 2.0, 1.0]), (10, 20, 30, 40)) == pytest.approx((20, 40, 60, 80))


@given(shifts, shifts, angles)
def test_rigid_parameters_invert_rigid(dx, dy, angle):
    center = (319.5, 179.5)
    parameters = g.rigid_parameters(g.rigid(dx, dy, angle, center), center)
    assert parameters == pytest.approx((dx, dy, angle), abs=1e-9)


def test_rigid_rotates_clockwise_on_screen():
    # x (right) must be mapped to y (down); the misprint of eq. 7 would change lengths.
    rotated = g.map_points(g.rigid(0, 0, np.pi / 2), [[1.0, 0.0]])
    np.testing.assert_allclose(rotated, [[0.0, 1.0]], atol=1e-12)


def test_a_roll_about_the_center_has_no_shift():
    center = g.frame_center((640, 360))
    roll = g.rigid(0, 0, np.deg2rad(0.5), center)
    assert g.rigid_parameters(roll, center)[:2] == pytest.approx((0, 0), abs=1e-9)
    assert np.hypot(*g.rigid_parameters(roll, (0, 0))[:2]) > 3  # at the origin it has


def test_corners_and_box():
    corners = g.corners_from_xywh((1, 2, 30, 40))
    np.testing.assert_array_equal(corners, [[1, 2], [31, 2], [31, 42], [1, 42]])
    assert g.xywh_from_corners(corners) == (1, 2, 30, 40)


def test_area_preserving_box_is_the_reference(golden):
    z = golden("functions.npz")
    for polygon, (cx, cy, w, h) in zip(z["aabb_in"], z["aabb_out"], strict=True):
        x, y, width, height = g.area_preserving_xywh(polygon)
        center = x + (width - 1) / 2, y + (height - 1) / 2
        assert (*center, width, height) == pytest.approx((cx, cy, w, h), abs=1e-6)


def test_a_mask_is_mapped_like_its_box():
    mask = np.zeros((90, 120), dtype=bool)
    mask[20:40, 30:60] = True
    moved = g.map_mask(g.rigid(7, -5, 0), mask, (120, 90))
    assert moved.dtype == bool
    np.testing.assert_array_equal(moved, np.roll(mask, (-5, 7), axis=(0, 1)))


@pytest.mark.parametrize(
    ("box", "message"),
    [
        pytest.param((np.nan, 1, 5, 5), "not finite", id="nan"),
        pytest.param((1, 1, np.inf, 5), "not finite", id="infinite"),
        pytest.param((1, 1, 0, 5), "empty", id="no width"),
        pytest.param((50, 40, -20, -10), "empty", id="swapped corners"),
        pytest.param((100, 10, 5, 5), "outside", id="right of the frame"),
        pytest.param((-30, 10, 20, 5), "outside", id="left of the frame"),
        pytest.param((1, 2, 3), "3 numbers", id="three numbers"),
    ],
)
def test_invalid_boxes_are_refused(box, message):
    with pytest.raises(ValueError, match=message):
        g.check_box(box, (100, 80))


@pytest.mark.parametrize(
    "frame",
    [
        pytest.param(np.zeros((4, 4), np.uint8), id="gray"),
        pytest.param(np.zeros((4, 4, 4), np.uint8), id="four channels"),
        pytest.param(np.zeros((4, 4, 3), np.float32), id="floats"),
        pytest.param(np.zeros((0, 4, 3), np.uint8), id="no rows"),
        pytest.param(None, id="none"),
    ],
)
def test_invalid_frames_are_refused(frame):
    with pytest.raises(ValueError, match="frame"):
        g.check_frame(frame)
