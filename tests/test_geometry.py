"""Boxes, transforms and masks, and the checks of boxes and frames."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ssiam import geometry as g
from ssiam.errors import ArgumentError, FrameSizeError

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


@given(shifts, shifts, angles, st.floats(0.5, 2), st.floats(-1e-4, 1e-4), st.floats(-1e-4, 1e-4))
def test_the_inverse_is_that_of_linear_algebra(dx, dy, angle, zoom, tilt_x, tilt_y):
    to_from_from = g.rigid(dx, dy, angle, (320, 180)) @ np.diag([zoom, zoom, 1.0])
    to_from_from[2, :2] = tilt_x, tilt_y
    inverse = g.inverse(to_from_from)
    np.testing.assert_allclose(inverse, np.linalg.inv(to_from_from), rtol=1e-9, atol=1e-9)


def test_a_shift_is_inverted_exactly():
    np.testing.assert_array_equal(g.inverse(g.rigid(0.1, -7.3, 0)), g.rigid(-0.1, 7.3, 0))
    with pytest.raises(np.linalg.LinAlgError):
        g.inverse(np.diag([1.0, 0, 1]))


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


def test_frames_are_checked_for_their_size():
    frame = np.zeros((8, 12, 3), np.uint8)
    assert g.check_frame(frame) == (12, 8)
    assert g.check_frame(frame, (12, 8)) == (12, 8)
    with pytest.raises(FrameSizeError, match="12x8 pixels after frames of 12x9"):
        g.check_frame(frame, (12, 9))
    with pytest.raises(FrameSizeError, match="after frames of 8x12"):
        g.check_frame(frame, (8, 12))


@pytest.mark.parametrize(
    "box",
    [
        pytest.param((1, 1, 1, 1), id="one pixel"),
        pytest.param((99.5, 79.5, 5, 5), id="last half pixel"),
        pytest.param((-4.5, -4.5, 5, 5), id="half a pixel inside"),
        pytest.param((-50, -40, 200, 160), id="twice the frame"),
    ],
)
def test_boxes_at_the_limits_are_valid(box):
    found = g.check_box(box, (100, 80))
    assert found == box
    assert all(type(value) is float for value in found)


@pytest.mark.parametrize(
    ("box", "message"),
    [
        pytest.param((1, 1, 0.9, 5), "empty", id="narrow"),
        pytest.param((1, 1, 5, 0.9), "empty", id="low"),
        pytest.param((100, 10, 5, 5), "outside", id="at the right edge"),
        pytest.param((10, 80, 5, 5), "outside", id="at the bottom edge"),
        pytest.param((-5, 10, 5, 5), "outside", id="at the left edge"),
        pytest.param((10, -5, 5, 5), "outside", id="at the top edge"),
        pytest.param((-50, 10, 200.5, 5), "more than 2 times", id="too wide"),
        pytest.param((10, -40, 5, 160.5), "more than 2 times", id="too high"),
    ],
)
def test_boxes_beyond_the_limits_are_refused(box, message):
    with pytest.raises(ArgumentError, match=message):
        g.check_box(box, (100, 80))


@pytest.mark.parametrize(
    "values",
    [
        pytest.param("1234", id="text"),
        pytest.param(b"1234", id="bytes"),
        pytest.param({1, 2, 3, 4}, id="set"),
        pytest.param(dict.fromkeys((1, 2, 3, 4)), id="mapping"),
        pytest.param(7, id="one number"),
        pytest.param(["1", 2, 3, 4], id="a text"),
        pytest.param([b"1", 2, 3, 4], id="some bytes"),
        pytest.param([[1], 2, 3, 4], id="a list in it"),
        pytest.param([np.ones(1), 2, 3, 4], id="an array in it"),
        pytest.param([10**400, 2, 3, 4], id="a huge number"),
        pytest.param([None, 2, 3, 4], id="none in it"),
    ],
)
def test_values_that_are_no_box_are_refused_by_name(values):
    with pytest.raises(ArgumentError, match=r"^box is .*: give four numbers"):
        g.xywh_floats(values)
    with pytest.raises(ArgumentError, match=r"^boxes\[2\] is "):
        g.xywh_floats(values, "boxes[2]")


def test_the_number_of_values_is_told():
    with pytest.raises(ArgumentError, match=r"^box \[1, 2, 3, 4, 5\] has 5 numbers"):
        g.xywh_floats([1, 2, 3, 4, 5])
    with pytest.raises(ArgumentError, match=r"^target .* has 3 numbers"):
        g.xywh_floats((1, 2, 3), "target")


def test_any_four_numbers_are_a_box():
    for values in ([1, 2, 3, 4], np.arange(1, 5), iter((1, 2.0, np.float32(3), np.array(4)))):
        found = g.xywh_floats(values)
        assert found == (1.0, 2.0, 3.0, 4.0)
        assert all(type(value) is float for value in found)


@pytest.mark.parametrize(
    "values",
    [[[1, 2], [3]], "12", ["1", "2"], [1, np.inf], [np.nan], [1j], [None], [10**400], object()],
)
def test_what_is_not_a_finite_array(values):
    assert g.finite_array(values) is None


@pytest.mark.parametrize("kind", [bool, np.int8, np.uint16, np.float32, np.float64])
def test_finite_arrays_are_float64(kind):
    found = g.finite_array(np.array([[0, 1]], kind))
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, [[0, 1]])


def test_long_values_are_cut():
    assert g.short_repr("a\nb") == repr("a\nb")
    assert g.short_repr(np.eye(2)) == "array([[1., 0.], [0., 1.]])"
    assert g.short_repr("x" * 78) == f"'{'x' * 78}'"
    assert g.short_repr("x" * 79) == f"'{'x' * 79}..."


def test_png_bytes_are_the_image():
    image = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
    data = g.png_bytes(image)
    assert data.startswith(b"\x89PNG")
    np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(data, np.uint8), 1), image)


HOMOGRAPHY = np.array([[1.1, 0.05, 12], [-0.04, 0.95, -7], [2e-4, -3e-4, 1.25]])


def test_a_point_is_mapped_as_by_opencv():
    points = [[100.0, 80.0], [3.0, 250.0]]
    expected = cv2.perspectiveTransform(np.array([points]), HOMOGRAPHY)[0]
    mapped = g.map_points(HOMOGRAPHY, points)
    np.testing.assert_allclose(mapped, expected, rtol=1e-12)
    assert mapped.dtype == np.float64
    for point, wanted in zip(points, expected, strict=True):
        assert g.map_point(HOMOGRAPHY, *point) == pytest.approx(wanted, rel=1e-12)


def jacobian(point):
    """The derivative (2, 2) of the homography's map at a point, by central differences."""
    steps = 0.01 * np.eye(2)
    high, low = (g.map_points(HOMOGRAPHY, point + sign * steps) for sign in (1, -1))
    return (high - low).T / 0.02


@pytest.mark.parametrize("point", [(0.0, 0.0), (100.0, 80.0), (300.0, 40.0)])
def test_zoom_and_angle_of_a_homography_are_those_of_its_derivative(point):
    (xx, xy), (yx, yy) = derivative = jacobian(np.array(point))
    zoom = np.sqrt(abs(np.linalg.det(derivative)))
    assert g.local_zoom(HOMOGRAPHY, point) == pytest.approx(zoom, rel=1e-6)
    dx, dy, angle = g.rigid_parameters(HOMOGRAPHY, point)
    assert (dx, dy) == pytest.approx(g.map_points(HOMOGRAPHY, [point])[0] - point)
    assert angle == pytest.approx(np.arctan2(yx - xy, xx + yy), rel=1e-6)
    mirrored = np.diag([-1.0, 1.0, 1.0]) @ HOMOGRAPHY
    assert g.local_zoom(mirrored, point) == pytest.approx(zoom, rel=1e-6)
    assert g.rigid_parameters(-HOMOGRAPHY, point) == pytest.approx((dx, dy, angle))


def test_a_mask_is_mapped_by_a_homography():
    mask = np.zeros((90, 120), dtype=bool)
    mask[20:40, 30:60] = True
    strong = np.array([[1.0, 0, 0], [0, 1, 0], [0.004, 0, 1]])
    moved = g.map_mask(strong, mask, (100, 70))
    assert moved.dtype == bool
    assert moved.shape == (70, 100)
    rows, columns = np.nonzero(moved)
    corners = g.map_points(strong, [[30, 20], [59, 20], [59, 39], [30, 39]])
    np.testing.assert_allclose((columns.min(), columns.max()), corners[[0, 1], 0], atol=1)
    assert np.ptp(rows[columns == columns.min()]) > np.ptp(rows[columns == columns.max()])


def test_masks_have_no_gray_edges():
    mask = np.zeros((30, 40), dtype=bool)
    mask[10:20, 10:20] = True
    assert g.map_mask(g.rigid(0.4, 0, 0), mask, (40, 30)).sum() == 100
    lower = np.array([[1.0, 0, 0.4], [0, 1, 0], [0, 1e-9, 1]])
    assert g.map_mask(lower, mask, (40, 30)).sum() == 100


def test_the_area_preserving_box_of_a_tilted_square():
    """Side 10, diagonal 10 sqrt(2): the box has the square's area, and a pixel more per side."""
    half = 10 / np.sqrt(2)
    corners = np.array([[50, 40 - half], [50 + half, 40], [50, 40 + half], [50 - half, 40]])
    assert g.area_preserving_xywh(corners) == pytest.approx((45, 35, 11, 11))
    assert g.area_preserving_xywh(corners.ravel(), 0.0) == pytest.approx((44.5, 34.5, 11, 11))
    wide = g.area_preserving_xywh([[10, 20], [50, 20], [50, 30], [10, 30]])
    assert wide == pytest.approx((10, 20, 41, 11))


def test_iou_of_boxes():
    box = (10, 10, 20, 10)
    others = [box, (20, 10, 20, 10), (30, 10, 5, 5), (10, 10, 20, -5), (10, 10, 10, 20)]
    found = g.iou(box, others)
    np.testing.assert_allclose(found, [1, 1 / 3, 0, 0, 1 / 3])
    assert np.isnan(g.iou(box, (np.nan, 0, 1, 1)))
    assert g.iou((5, 5, 0, 0), (5, 5, 0, 0)) == 0
    assert g.iou((0.0, 0.0, 0.5, 0.5), (0.0, 0.0, 0.5, 0.5)) == 1
    assert g.iou((0, 0, 1, 1), (0, 0, 1, 3)) == pytest.approx(1 / 3)


def test_the_identity_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        g.IDENTITY[0, 0] = 2


def test_results_of_whole_numbers_are_floats():
    ints = [[1, 2], [31, 2], [31, 42], [1, 42]]
    assert g.map_points(np.eye(3, dtype=int), ints).dtype == np.float64
    assert g.corners_from_xywh((1, 2, 30, 40)).dtype == np.float64
    single = np.float32([[1, 2], [3, 5]])
    assert g.map_points(np.eye(3), single).dtype == np.float64
    found = g.xywh_from_corners(ints), g.area_preserving_xywh(ints), g.xywh_floats((1, 2, 3, 4))
    assert all(type(value) is float for box in found for value in box)
    assert g.iou((0, 0, 2, 2), (0, 0, 2, 4)).dtype == np.float64
    precise = np.float32([[16777216, 0, 1, 1]])
    assert g.iou(precise, precise + np.array([0.5, 0, 0, 0])) == pytest.approx(1 / 3)
    box = g.map_box(np.eye(3), (np.int64(1), 2, 3, 4))
    assert all(type(value) is float for value in box)


@pytest.mark.parametrize(
    ("frame", "shown"),
    [
        ([1, 2], "not list"),
        ("frame", "not str"),
        (np.zeros((4, 5), np.uint8), r"not \(4, 5\) uint8"),
        (np.zeros((4, 5, 3), np.float32), r"not \(4, 5, 3\) float32"),
        (np.zeros((4, 5, 2), np.uint8), r"not the shape \(4, 5, 2\)"),
        (np.zeros((4, 0, 3), np.uint8), r"not the shape \(4, 0, 3\)"),
    ],
)
def test_what_was_given_in_place_of_a_frame_is_told(frame, shown):
    with pytest.raises(ArgumentError, match=shown):
        g.check_frame(frame)


def test_bounds_of_a_mask_are_those_of_its_target():
    mask = np.zeros((9, 7), dtype=bool)
    assert g.mask_bounds(mask) == (slice(0, 0), slice(0, 0))
    mask[2, 5] = mask[6, 3] = True
    assert g.mask_bounds(mask) == (slice(2, 7), slice(3, 6))
    assert g.mask_bounds(~mask) == (slice(0, 9), slice(0, 7))
