"""Flat areas around the scene: convex scenes only, so that a flat sky is part of the scene."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import world
from ssiam.motion.flat_areas import flat_outside, without_rim

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
