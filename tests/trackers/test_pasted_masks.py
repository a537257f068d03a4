"""Pasted masks of boxes: pixels of cells, spans of the frame, and rotated boxes."""

import cv2
import numpy as np
import pytest

from ssiam.geometry import corners_from_xywh
from ssiam.trackers.box_mask import (
    PastedMask,
    intersection,
    paste,
    rotated_box,
    visible_span,
)


def span(left, top, right, bottom):
    return np.array([left, top], float), np.array([right, bottom], float)


def test_spans():
    low, end = visible_span((40, 30), 7)
    assert (low.tolist(), end.tolist()) == ([-7, -7], [47, 37])
    first, last = intersection(span(0, 5, 40, 30), span(10, -5, 60, 20))
    assert (first.tolist(), last.tolist()) == ([10, 5], [40, 20])
    only = intersection(span(1, 2, 3, 4))
    assert [each.tolist() for each in only] == [[1, 2], [3, 4]]


def checkered(rows, columns, on):
    logits = np.full((rows, columns), -20, np.float32)
    for row, column in on:
        logits[row, column] = 20
    return logits


def test_a_cell_is_pasted_as_the_pixels_that_it_covers():
    """Between two centers, half belongs to each; the corners are rounded."""
    logits = checkered(8, 8, [(r, c) for r in range(2, 5) for c in range(1, 7)])
    mask = paste(logits, np.array([10.0, 20.0]), np.array([4.0, 6.0]), span(0, 0, 60, 80))
    rows, columns = np.nonzero(mask.part)
    assert (columns.min(), columns.max()) == (10 + 4, 10 + 4 * 7 - 1)
    assert (rows.min(), rows.max()) == (20 + 6 * 2, 20 + 6 * 5 - 1)
    assert mask.part.sum() == 24 * 18 - 8
    assert (mask.part.dtype, mask.corner_xy) == (bool, (0, 0))
    assert mask.part.shape == (80, 60)


def test_a_span_cuts_the_mask():
    logits = checkered(8, 8, [(r, c) for r in range(2, 5) for c in range(1, 7)])
    whole = paste(logits, np.array([10.0, 20.0]), np.array([4.0, 6.0]), span(0, 0, 60, 80))
    part = paste(logits, np.array([10.0, 20.0]), np.array([4.0, 6.0]), span(17, 30, 33, 44))
    assert part.corner_xy == (17, 30)
    np.testing.assert_array_equal(part.part, whole.part[30:44, 17:33])
    empty = paste(logits, np.array([10.0, 20.0]), np.array([4.0, 6.0]), span(17, 30, 12, 30))
    assert empty.part.shape == (1, 1)


def test_a_logit_of_zero_is_not_on_the_target():
    for logit, on in ((-0.1, False), (0.0, False), (0.02, True)):
        logits = np.full((4, 4), logit, np.float32)
        mask = paste(logits, np.zeros(2), np.full(2, 4.0), span(4, 4, 8, 8))
        assert mask.part.all() == mask.part.any() == on


@pytest.mark.parametrize(
    "corner", [(3, 4), (-5, -6), (35, 26), (-5, 26), (60, 2), (2, 60), (-50, 0), (0, -50)]
)
def test_a_part_in_the_whole_frame(corner):
    random = np.random.default_rng(3).random((9, 12)) < 0.5
    large = np.zeros((300, 300), bool)
    large[100 + corner[1] : 109 + corner[1], 100 + corner[0] : 112 + corner[0]] = random
    found = PastedMask(random, corner).full((40, 30))
    assert found.dtype == bool
    np.testing.assert_array_equal(found, large[100:130, 100:140])


def filled(rows, columns):
    part = np.zeros((120, 160), bool)
    part[slice(*rows), slice(*columns)] = True
    return PastedMask(part, (30, 20))


def test_the_box_of_a_mask_is_in_pixels_of_the_frame():
    found = rotated_box(filled((10, 60), (20, 100)), (50.0, 30.0, 80.0, 50.0))
    assert sorted(map(tuple, found.round(3))) == [(50, 30), (50, 79), (129, 30), (129, 79)]


@pytest.mark.parametrize(("right", "agrees"), [(87, True), (86, False)])
def test_a_box_that_disagrees_with_the_upright_one_is_replaced(right, agrees):
    """Its bounds must overlap by 80 %: here 66 and 65 of 80 px, by 49 of 50."""
    xywh = (50.0, 30.0, 80.0, 50.0)
    found = rotated_box(filled((10, 60), (20, right)), xywh)
    upright = corners_from_xywh(xywh)
    assert np.array_equal(found, upright) != agrees


def diagonal(side, thickness):
    part = np.zeros((side, side), np.uint8)
    cv2.line(part, (0, 0), (side - 1, side - 1), 1, thickness)
    return part.astype(bool)


@pytest.mark.parametrize(("thickness", "counts"), [(1, False), (2, True)])
def test_a_mask_of_a_large_box_has_more_than_100_square_pixels(thickness, counts):
    """Areas are between pixel centers: 0 and 152 px^2; a fourth of the box would be 380."""
    xywh = (30.0, 20.0, 39.0, 39.0)
    found = rotated_box(PastedMask(diagonal(40, thickness), (30, 20)), xywh)
    assert np.array_equal(found, corners_from_xywh(xywh)) != counts


def test_a_mask_of_a_small_box_needs_a_fourth_of_it():
    xywh = (50.0, 30.0, 9.5, 9.5)
    found = rotated_box(filled((10, 20), (20, 30)), xywh)  # 81 px^2
    assert sorted(map(tuple, found.round(3))) == [(50, 30), (50, 39), (59, 30), (59, 39)]


def test_without_a_mask_the_box_is_upright():
    none = PastedMask(np.zeros((5, 5), bool), (0, 0))
    xywh = (50.0, 30.0, 8.0, 9.0)
    np.testing.assert_array_equal(rotated_box(none, xywh), corners_from_xywh(xywh))
