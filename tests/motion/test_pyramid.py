"""The small images of a frame, and the units of direct alignment."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import generator
from ssiam.geometry import map_points
from ssiam.motion.pyramid import PyramidBuilder

SIZES = {  # of the frame: fine and coarse level
    (640, 360): ((320, 180), (80, 45)),
    (360, 640): ((180, 320), (45, 80)),
    (1920, 1080): ((320, 180), (80, 45)),
    (100, 37): ((320, 118), (80, 30)),
    (320, 240): ((320, 240), (80, 60)),
    (3000, 2): ((320, 1), (80, 1)),
}


@pytest.mark.parametrize("size", SIZES)
def test_sizes_of_the_levels(size):
    builder = PyramidBuilder(size)
    assert (builder.fine_wh, builder.coarse_wh) == SIZES[size]
    pyramid = builder.from_frame(np.zeros((size[1], size[0], 3), np.uint8))
    levels = pyramid.fine, pyramid.coarse, pyramid.tiny
    sizes = [each.shape[::-1] for each in levels]
    assert sizes[:2] == list(SIZES[size])
    assert sizes[2] == tuple((side + 1) // 2 for side in sizes[1])
    assert {each.dtype for each in levels} == {np.dtype(np.uint8)}


@pytest.mark.parametrize("size", SIZES)
def test_a_unit_is_half_of_the_longer_side_and_0_the_center(size):
    builder = PyramidBuilder(size)
    width, height = size
    center = (width - 1) / 2, (height - 1) / 2
    half = max(size) / 2
    points = map_points(builder.frame_from_unit, [(0, 0), (1, 0), (0, 1)])
    expected = np.array([center, (center[0] + half, center[1]), (center[0], center[1] + half)])
    np.testing.assert_allclose(points, expected)
    np.testing.assert_allclose(
        builder.unit_from_frame @ builder.frame_from_unit, np.eye(3), atol=1e-12
    )


@pytest.mark.parametrize("size", SIZES)
def test_pixels_of_the_levels_are_those_of_cv2_resize(size):
    """The outer edges of first and last pixel stay where they are."""
    builder = PyramidBuilder(size)
    fine_from_frame = builder.fine_from_unit @ builder.unit_from_frame
    (width, height), (fine_w, fine_h) = size, builder.fine_wh
    edges = map_points(fine_from_frame, [(-0.5, -0.5), (width - 0.5, height - 0.5)])
    np.testing.assert_allclose(edges, [(-0.5, -0.5), (fine_w - 0.5, fine_h - 0.5)], atol=1e-9)
    np.testing.assert_allclose(
        builder.coarse_from_unit, np.diag([0.25, 0.25, 1]) @ builder.fine_from_unit
    )
    x_scale, y_scale = fine_w / width, fine_h / height
    half = max(size) / 2
    np.testing.assert_allclose(builder.tiny_per_unit, [half * x_scale / 8, half * y_scale / 8])


def test_boxes_in_units():
    builder = PyramidBuilder((640, 360))
    boxes = np.array([[319.5, 179.5, 319.5 + 320, 179.5 + 160], [-0.5, 19.5, 159.5, 179.5]])
    np.testing.assert_allclose(builder.in_units(boxes), [[0, 0, 1, 0.5], [-1, -0.5, -0.5, 0]])


@pytest.mark.parametrize("size", [(640, 40), (1279, 40), (1280, 40)])
def test_the_fine_level_is_gray_and_slightly_blurred(size):
    """Frames are made small first, which is faster."""
    frame = generator(3).integers(0, 256, (size[1], size[0], 3)).astype(np.uint8)
    builder = PyramidBuilder(size)
    pyramid = builder.from_frame(frame)
    small = cv2.cvtColor(cv2.resize(frame, builder.fine_wh), cv2.COLOR_BGR2GRAY)
    expected = cv2.GaussianBlur(small, (3, 3), 0)
    np.testing.assert_array_equal(pyramid.fine, expected)
    coarse = cv2.pyrDown(cv2.pyrDown(expected))
    np.testing.assert_array_equal(pyramid.coarse, coarse)
    np.testing.assert_array_equal(pyramid.tiny, cv2.pyrDown(coarse))
