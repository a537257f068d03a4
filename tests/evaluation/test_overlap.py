"""Overlaps: properties, known cases, golden numbers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.any_regions import BOUNDS, BOXES, POLYGONS
from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.overlap import center_distance, toolkit_overlap, vot_overlap
from ssiam.evaluation.measures.regions import Bounds, is_empty
from ssiam.geometry import iou

NAN = np.nan
BOTH = pytest.mark.parametrize("overlap", [vot_overlap, toolkit_overlap], ids=["pysot", "vot"])


def corners(box):
    x, y, w, h = box[0]
    return np.array([[x, y, x + w, y, x + w, y + h, x, y + h]])


@BOTH
@settings(max_examples=50, deadline=None)
@given(box=BOXES)
def test_a_region_has_overlap_1_with_itself(overlap, box):
    assert overlap(box, box, BOUNDS) == 1
    assert overlap(corners(box), corners(box), BOUNDS) == 1


@BOTH
@settings(max_examples=50, deadline=None)
@given(a=POLYGONS, b=POLYGONS)
def test_symmetric_and_between_0_and_1(overlap, a, b):
    forward, backward = overlap(a, b, BOUNDS), overlap(b, a, BOUNDS)
    np.testing.assert_array_equal(forward, backward)
    assert np.isnan(forward[0]) or 0 <= forward[0] <= 1


@BOTH
@settings(max_examples=50, deadline=None)
@given(a=BOXES, b=BOXES, dx=st.integers(-4, 8), dy=st.integers(-4, 8))
def test_invariant_to_integer_shifts(overlap, a, b, dx, dy):
    wide = (200, 200)
    # Multiples of 1/128 px, exact in float32 after the shift. No corner ends in .5, which would be
    # rounded to even.
    a, b = (np.round(box * 64) / 64 + [1 / 128, 1 / 128, 0, 0] for box in (a, b))
    shift = np.array([dx, dy] * 4) + 20
    expected = overlap(corners(a) + 20, corners(b) + 20, wide)
    np.testing.assert_array_equal(overlap(corners(a) + shift, corners(b) + shift, wide), expected)


PYSOT_CASES = [
    # name, region, truth, bounds, overlap
    ("missing region", [NAN] * 4, [1, 1, 9, 9], BOUNDS, NAN),
    ("missing truth", [1, 1, 9, 9], [NAN] * 4, BOUNDS, NAN),
    ("apart", [0, 0, 5, 5], [20, 20, 5, 5], BOUNDS, 0),
    ("touching at a border", [0, 0, 5, 5], [5, 0, 5, 5], BOUNDS, 0),
    ("half, borders drawn", [0, 0, 9, 9], [5, 0, 9, 9], BOUNDS, 50 / 150),
    ("outside of the image", [70, 0, 5, 5], [70, 0, 5, 5], BOUNDS, 0),
    ("crossing the border, clipped", [60, 0, 20, 9], [60, 0, 3, 9], BOUNDS, 4 / 5),
    ("no bounds", [60, 0, 19, 9], [60, 0, 4, 9], None, 5 / 20),
    ("tiny truth", [0, 0, 60, 40], [3, 3, 1e-9, 1e-9], BOUNDS, 0),
]


@pytest.mark.parametrize(
    ("region", "truth", "bounds", "expected"),
    [pytest.param(*case[1:], id=case[0]) for case in PYSOT_CASES],
)
def test_pysot_cases(region, truth, bounds, expected):
    found = vot_overlap([region], [truth], bounds)
    np.testing.assert_allclose(found, [expected], atol=1e-6)


TOOLKIT_CASES = [
    # name, region, truth, overlap
    ("missing region", [NAN] * 4, [1, 1, 9, 9], 0),
    ("both missing", [NAN] * 4, [NAN] * 4, 1),
    ("rectangle and polygon", [10, 10, 20, 20], [10, 10, 30, 10, 30, 30, 10, 30], 400 / 441),
    ("rectangles", [10, 10, 20, 20], [20, 10, 20, 20], 200 / 600),
    ("no height", [10, 10, 20, 0], [10, 10, 20, 20], 0),
    ("one column, thin polygon", [10, 10, 10, 30, 10, 20, 10, 15], [8, 10, 5, 21], 21 / 105),
]


@pytest.mark.parametrize(
    ("region", "truth", "expected"),
    [pytest.param(*case[1:], id=case[0]) for case in TOOLKIT_CASES],
)
def test_toolkit_cases(region, truth, expected):
    assert toolkit_overlap([region], [truth], BOUNDS) == pytest.approx(expected)


@BOTH
def test_rectangles_and_polygons_in_one_array(overlap):
    box = [10, 10, 20, 15]
    mixed = np.array([[*box, NAN, NAN, NAN, NAN], corners(np.array([box]))[0], [NAN] * 8])
    alone = [
        overlap([row[~np.isnan(row)]] if row[0] > 0 else [row], [box], BOUNDS) for row in mixed
    ]
    np.testing.assert_array_equal(overlap(mixed, [box] * 3, BOUNDS), np.concatenate(alone))


@BOTH
def test_no_frames(overlap):
    assert overlap(np.zeros((0, 8)), np.zeros((0, 4)), BOUNDS).shape == (0,)


def test_a_region_larger_than_any_image_is_refused():
    with pytest.raises(ArgumentError, match="rows of pixels; give bounds"):
        vot_overlap([[0, 0, 1e7, 1e7]], [[0, 0, 1e7, 1e7]])
    assert vot_overlap([[0, 0, 1e7, 1e7]], [[0, 0, 10, 10]], BOUNDS)[0] < 0.05


@BOTH
@pytest.mark.parametrize("far", [1e30, 1e300, -1e300])
def test_coordinates_far_outside_of_any_image(overlap, far):
    with np.errstate(all="raise", under="ignore"):
        found = overlap([[-far, 0, far, far], [0, 0, far, 9]], [[0, 0, 10, 10]] * 2, BOUNDS)
    assert ((found >= 0) & (found <= 1)).all()


@BOTH
def test_a_polygon_with_nan_is_not_a_region(overlap):
    broken = [[1, 1, 9, 1, NAN, 9, 1, 9]]
    np.testing.assert_array_equal(
        overlap(broken, [[1, 1, 8, 8]], BOUNDS), overlap([[NAN] * 8], [[1, 1, 8, 8]], BOUNDS)
    )


@BOTH
@pytest.mark.parametrize(
    ("regions", "words"),
    [(np.zeros((3, 4)), "3 regions for 2 frames"), (np.zeros((2, 6)), "shape (2, 6)")],
)
def test_arrays_of_wrong_shape_are_refused(overlap, regions, words):
    with pytest.raises(ArgumentError) as caught:
        overlap(regions, np.zeros((2, 4)), BOUNDS)
    assert words in str(caught.value)


IOU_CASES = [
    # name, box, other, iou, distance of the centers
    ("same", [1, 2, 3, 4], [1, 2, 3, 4], 1, 0),
    ("half", [0, 0, 10, 10], [5, 0, 10, 10], 1 / 3, 5),
    ("apart", [0, 0, 1, 1], [30, 40, 1, 1], 0, 50),
    ("inside", [0, 0, 10, 10], [4, 4, 2, 2], 0.04, 0),
    ("no area", [0, 0, 0, 0], [0, 0, 0, 0], 0, 0),
    ("negative size", [5, 5, -5, -5], [0, 0, 10, 10], 0, np.hypot(2.5, 2.5)),
    ("unknown", [NAN] * 4, [0, 0, 10, 10], NAN, NAN),
]


@pytest.mark.parametrize(
    ("box", "other", "expected", "distance"),
    [pytest.param(*case[1:], id=case[0]) for case in IOU_CASES],
)
def test_iou_and_distance(box, other, expected, distance):
    np.testing.assert_allclose(iou([box], [other]), [expected])
    np.testing.assert_allclose(center_distance([box], [other]), [distance])


def test_distances_of_whole_numbers():
    found = center_distance([[0, 0, 2, 2]], [[3, 4, 2, 2]])
    assert found.tolist() == [5]
    assert center_distance([[0, 0, 2, 2]], [[6, 4, 2, 4]], in_sizes=True) == pytest.approx(
        [np.hypot(6 / 2, 5 / 4)]
    )
    assert found.dtype == np.float64


def test_rectangles_without_width_or_height_are_empty():
    left, top, right, bottom = np.array(
        [[0.0, 0, 5, 9], [5, 0, 5, 9], [6, 0, 5, 9], [0, 9, 5, 9], [0, 10, 5, 9]]
    ).T
    found = is_empty(Bounds(left, top, right, bottom))
    assert found.tolist() == [False, True, True, True, True]
