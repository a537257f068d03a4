"""Rotated boxes of masks, compared with the references and on known shapes."""

import cv2
import numpy as np
import pytest

from helpers.tracker_loops import corner_distance, of_this_opencv
from ssiam.trackers.rotated_boxes import (
    _level_mask,
    _refined,
    _sides,
    _tightened,
    ellipse_box,
    rectangle_box,
)

SIZE = (320, 240)
NAMES = [
    "ellipse30",
    "ellipse_axis",
    "rect20",
    "rect_axis",
    "circle",
    "limb",
    "L",
    "border",
    "corner",
    "two",
    "tiny",
    "thin",
    "empty",
]
SMALL = ("tiny", "empty")


@pytest.fixture
def functions(golden):
    return golden("loops/functions.npz")


def mask_of(functions, name):
    bits = np.unpackbits(functions[f"mask_bits_{name}"])[: SIZE[0] * SIZE[1]]
    return bits.reshape(SIZE[1], SIZE[0]).astype(bool)


def test_all_masks_of_the_golden_file_are_tested(functions):
    assert list(functions["mask_names"]) == NAMES


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("kind", "fit"),
    [("siammask_box", rectangle_box), ("siammask_e_box", lambda mask: ellipse_box(mask, 0.2583))],
    ids=["siammask", "siammask_e"],
)
def test_boxes_are_the_references(functions, golden, kind, fit, name):
    box = fit(mask_of(functions, name))
    if name in SMALL:
        assert box is None
    else:
        expected = golden(of_this_opencv("loops/functions"))[f"{kind}_{name}"]
        assert corner_distance(box, expected) < 1e-4


def rotated_ellipse(angle, center=(150, 110), axes=(120, 50)):
    canvas = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    return cv2.ellipse(canvas, (center, axes, angle), 1, -1).astype(bool)


@pytest.mark.parametrize("angle", [0, 30, 60, 90, 135])
@pytest.mark.parametrize("fit", [rectangle_box, ellipse_box])
def test_the_box_of_a_rotated_ellipse(fit, angle):
    box = fit(rotated_ellipse(angle))
    sides = np.sort(np.linalg.norm(np.diff(box[:3], axis=0), axis=1))
    np.testing.assert_allclose(box.mean(axis=0), (150, 110), atol=1.0)
    np.testing.assert_allclose(sides, (50, 120), atol=4.0)
    long_side = max(np.diff(box[:3], axis=0), key=np.linalg.norm)
    along = abs(long_side @ (np.cos(np.radians(angle)), np.sin(np.radians(angle))))
    assert along == pytest.approx(np.linalg.norm(long_side), rel=5e-3)


def test_the_refinement_only_shrinks_the_box():
    mask = rotated_ellipse(30) | rotated_ellipse(120, center=(190, 130), axes=(60, 10))
    areas = [cv2.contourArea(ellipse_box(mask, f).astype(np.float32)) for f in (None, 0.1, 0.4)]
    assert areas[0] >= areas[1] > areas[2]


@pytest.mark.parametrize("shape", ["line", "two lines", "frame", "half frame"])
@pytest.mark.parametrize("factor", [None, 0.2583, 5.0])
def test_odd_masks_give_finite_boxes_or_none(shape, factor):
    mask = np.zeros((SIZE[1], SIZE[0]), bool)
    match shape:
        case "line":
            mask[100, :] = True
        case "two lines":
            mask[100:102, :] = True
        case "frame":
            mask[:] = True
        case "half frame":
            mask[120:] = True
    box = ellipse_box(mask, factor)
    assert (box is None) == (shape == "line")
    assert box is None or np.isfinite(box).all()


def test_a_degenerate_ellipse_falls_back_to_the_rectangle(monkeypatch):
    mask = rotated_ellipse(30)
    expected = rectangle_box(mask)
    for ellipse in (((9999.0, 9999.0), (3.0, 4.0), 10.0), ((1.0, float("nan")), (3.0, 4.0), 10.0)):
        monkeypatch.setattr(cv2, "fitEllipse", lambda contour, ellipse=ellipse: ellipse)
        np.testing.assert_array_equal(ellipse_box(mask, 0.2583), expected)


def test_only_components_of_more_than_the_minimum_area_have_a_box():
    """OpenCV's area of a contour is that between the centers of its pixels."""
    mask = np.zeros((60, 60), bool)
    mask[10:21, 10:21] = True  # 100 px^2
    assert rectangle_box(mask) is None
    assert ellipse_box(mask) is None
    mask[10:21, 21] = True
    assert rectangle_box(mask) is not None
    assert ellipse_box(mask) is not None
    assert rectangle_box(mask, 110.0) is None
    assert rectangle_box(mask, 109.0) is not None
    assert rectangle_box(np.zeros((60, 60), bool)) is None


@pytest.mark.parametrize("fit", [rectangle_box, ellipse_box])
def test_the_largest_component_is_boxed(fit):
    for order in (1, -1):
        mask = np.zeros((90, 90), bool)
        mask[::order][5:20, 5:20] = True
        mask[::order][40:80, 30:80] = True
        mask[::order][84:, 84:] = True
        box = fit(mask)
        center = (54.5, 59.5 if order == 1 else 29.5)
        np.testing.assert_allclose(box.mean(axis=0), center, atol=1)


def test_the_rectangle_of_a_rectangle():
    mask = np.zeros((90, 90), bool)
    mask[20:50, 10:80] = True
    box = rectangle_box(mask)
    assert box.dtype == np.float64
    assert sorted(map(tuple, box.round(3))) == [(10, 20), (10, 49), (79, 20), (79, 49)]


def test_tightened_ends_have_enough_pixels():
    filled = np.array([0] * 10 + [5] * 30 + [0] * 11)
    low, high = _tightened(filled, 0.0, 50.0, 5)
    assert (int(low), int(high)) == (10, 39)
    assert _tightened(filled, 12.5, 30.5, 5) == (12.5, 30.5)
    assert _tightened(filled, 12.5, 30.5, 4.9) == (12.5, 30.5)


def test_each_step_is_a_fiftieth_of_the_length_low_end_first():
    filled = np.array([0] + [5] * 99 + [0])
    low, high = _tightened(filled, 0.0, 100.0, 5)
    assert low == pytest.approx(2)
    assert high == pytest.approx(100 - 0.02 * 98)


def test_ends_that_never_have_enough_pixels_stay_on_the_mask():
    filled = np.zeros(40)
    low, high = _tightened(filled, 0.0, 39.0, 5)
    assert 38 < low < 39
    assert high == 39
    low, high = _tightened(filled, 0.0, 30.0, 5)
    assert 29 < low < 30
    assert high - low < 1
    assert high == 30


def test_the_high_end_moves_down_to_the_first_line():
    """The low end is on the mask; the high end stops where less than a pixel is left."""
    filled = np.array([9] + [0] * 39)
    low, high = _tightened(filled, 0.0, 39.0, 5)
    assert low == 0
    assert 0 < high < 1


def test_sides_of_an_ellipse_that_is_partly_outside_of_the_mask():
    """They are limited to the mask's last pixel on each side."""
    contour = np.array([[10.0, 10], [30, 10], [30, 25], [10, 25]])
    large = np.array([[-20.0, -20], [90, -20], [90, 90], [-20, 90]])
    assert _sides(large, contour, (60, 80)) == (10, 10, 31, 26)
    small = np.array([[12.0, 14], [28, 14], [28, 20], [12, 20]])
    inside = np.array([[13.0, 15], [20, 16], [27, 19]])
    assert _sides(small, inside, (60, 80)) == (13, 15, 28, 20)
    assert _sides(large, contour, (20, 25)) == (10, 10, 24, 19)
    beyond = contour - 15.0  # from -5 to 15 and 10
    assert _sides(large, beyond, (60, 80)) == (0, 0, 16, 11)


def test_sides_are_refined_to_a_share_of_the_mask():
    level = np.zeros((60, 80), np.uint8)
    level[20:40, 20:60] = 1
    level[28:32, 10:20] = 1  # a limb to the left
    level[10:20, 38:42] = 1  # and one upwards
    assert _refined(level, (10.0, 10.0, 60.0, 40.0), 0.0) == (10, 10, 60, 40)
    left, top, right, bottom = _refined(level, (10.0, 10.0, 59.0, 39.0), 0.3)
    assert 20 <= left < 21
    assert 20 <= top < 21
    assert (right, bottom) == (59, 39)


def test_the_leveled_mask_has_its_ellipse_upright():
    mask = rotated_ellipse(30)
    level = _level_mask(mask, cv2.getRotationMatrix2D((150, 110), 30, 1))
    assert level.shape == mask.shape
    assert set(np.unique(level)) == {0, 1}
    rows, columns = np.nonzero(level)
    assert np.ptp(columns) == pytest.approx(120, abs=3)
    assert np.ptp(rows) == pytest.approx(50, abs=3)
