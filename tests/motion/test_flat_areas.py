"""Flat areas around the scene: convex scenes only, so that a flat sky is part of the scene."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import world
from ssiam.motion.flat_areas import flat_outside, is_blank, without_rim

SIZE = (160, 120)


def scene():
    return np.clip(cv2.cvtColor(world(2, SIZE), cv2.COLOR_BGR2GRAY), 60, 255)


@pytest.mark.parametrize("level", [0, 30])
def test_the_area_around_a_circular_image_is_found(level):
    circle = np.zeros(SIZE[::-1], np.uint8)
    cv2.circle(circle, (80, 60), 55, 255, -1)
    frame = np.where(circle > 0, scene(), level).astype(np.uint8)
    outside = flat_outside(frame)
    np.testing.assert_array_equal(outside, 255 - circle)
    inner = without_rim(outside)
    assert not inner[circle == 0].any()
    assert 0.8 < np.count_nonzero(inner) / np.count_nonzero(circle) < 1


def test_a_flat_sky_over_towers_is_part_of_the_scene():
    frame = scene()
    for left in (0, 60, 120):
        frame[:90, left : left + 30] = 10
    assert flat_outside(frame) is None


def test_a_frame_without_a_flat_area_has_none():
    assert flat_outside(scene()) is None
    assert flat_outside(np.zeros(SIZE[::-1], np.uint8)) is None


def framed(level=0, *, size=SIZE, radius=55, noise=0):
    """A scene in a circle; the area around it has one level, or noise above it."""
    circle = np.zeros(size[::-1], np.uint8)
    cv2.circle(circle, (size[0] // 2, size[1] // 2), radius, 255, -1)
    around = np.full(size[::-1], level, np.uint8)
    if noise:
        around += np.random.default_rng(1).integers(0, noise + 1, size[::-1]).astype(np.uint8)
    gray = np.clip(cv2.cvtColor(world(2, size), cv2.COLOR_BGR2GRAY), 60, 230)
    return np.where(circle > 0, gray, around).astype(np.uint8), circle


@pytest.mark.parametrize(("deviation", "blank"), [(0, True), (4, True), (5, True), (6, False)])
def test_blank_frames_deviate_by_less_than_two_and_a_half_levels(deviation, blank):
    gray = np.full((20, 30), 100, np.uint8)
    gray[:, ::2] += np.uint8(deviation)
    assert is_blank(gray) is (blank and deviation < 5)


@pytest.mark.parametrize(
    ("corners", "found"),
    [
        ([0, 0, 0, 0], True),
        ([240, 240, 240, 240], True),
        ([240, 240, 242, 238], True),
        ([240, 240, 240, 243], True),  # three of them match
        ([240, 240, 243, 246], False),
        ([240, 237, 243, 246], False),
    ],
)
def test_three_corners_match_or_the_area_is_dark(corners, found):
    frame, circle = framed(240 if corners[0] else 0)
    h, w = frame.shape
    for (y, x), level in zip(
        ((0, 0), (h - 1, 0), (0, w - 1), (h - 1, w - 1)), corners, strict=True
    ):
        part = frame[y : y + 1 or None, x : x + 1 or None]
        part[:] = level
    outside = flat_outside(frame)
    assert (outside is not None) == found
    if found:
        assert (outside[circle > 0] == 0).all()


@pytest.mark.parametrize(("level", "found"), [(24, True), (25, False)])
def test_a_dark_corner_is_enough(level, found):
    """The area is in one corner; the others are of the scene."""
    frame = scene()
    triangle = np.array([[0, 0], [50, 0], [0, 50]])
    cv2.fillConvexPoly(frame, triangle, level)
    outside = flat_outside(frame)
    assert (outside is not None) == found
    if found:
        expected = np.zeros_like(frame)
        cv2.fillConvexPoly(expected, triangle, 255)
        assert (outside != expected).mean() < 0.002


def test_an_area_of_two_levels_around_the_corner():
    frame, circle = framed(30)
    frame[:, :20][circle[:, :20] == 0] = 32
    assert flat_outside(frame) is None, "a deviation of more than half a level"
    frame, circle = framed(30)
    frame[5:9, 5:9] = 32
    np.testing.assert_array_equal(flat_outside(frame), 255 - circle)
    frame[5:9, 5:9] = 33
    assert flat_outside(frame) is None, "the spot belongs to the scene, which is not convex then"


def test_noise_is_not_flat():
    assert flat_outside(framed(10, noise=1)[0]) is not None
    assert flat_outside(framed(10, noise=2)[0]) is None


@pytest.mark.parametrize(("side", "found"), [(13, False), (15, True)])
def test_the_least_area_is_half_a_percent(side, found):
    """Of 160 x 120 px: 96 px."""
    frame = scene()
    cv2.fillConvexPoly(frame, np.array([[0, 0], [side - 1, 0], [0, side - 1]]), 0)
    assert (flat_outside(frame) is not None) == found


def test_a_scene_of_less_than_half_a_percent_is_none():
    for width, found in ((9, False), (10, True)):
        frame = np.zeros(SIZE[::-1], np.uint8)
        frame[50:60, 70 : 70 + width] = 100
        assert (flat_outside(frame) is not None) == found


@pytest.mark.parametrize(("notch", "convex"), [(12, True), (15, False)])
def test_a_scene_fills_its_hull(notch, convex):
    frame = scene()
    frame[:, :20] = frame[:, -20:] = 0
    frame[60 - notch : 60 + notch, :36] = 0
    assert (flat_outside(frame) is not None) == convex


def test_the_rim_is_three_pixels_wide():
    outside = np.zeros((40, 50), np.uint8)
    outside[:, :10] = 255
    inner = without_rim(outside)
    assert inner.dtype == np.uint8
    assert not inner[:, :13].any()
    assert (inner[:, 13:] == 255).all()
