"""Each keypoint generator finds what its name promises, and enough of it."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import world
from ssiam.motion.keypoints import KeypointGenerator, _spread

SIZE = (640, 360)
TEXTURED = cv2.cvtColor(world(), cv2.COLOR_BGR2GRAY)
MINIMUM = {  # keypoints of a textured frame, and cells of a 16 x 12 grid that they cover
    "orb": (400, 120),
    "gftt": (150, 90),
    "harris": (120, 80),
    "brisk": (200, 80),
    "mser": (40, 25),
}


@pytest.mark.parametrize("name", MINIMUM)
def test_a_textured_frame_has_keypoints_all_over(name):
    points = KeypointGenerator(name)(TEXTURED, None)
    min_points, min_cells = MINIMUM[name]
    assert len(points) >= min_points
    assert len(_spread(points, SIZE)) >= min_cells


@pytest.mark.parametrize("name", MINIMUM)
def test_no_keypoint_is_outside_of_the_mask(name):
    mask = np.full(TEXTURED.shape, 255, np.uint8)
    mask[100:260, 200:440] = 0
    points = KeypointGenerator(name)(TEXTURED, mask)
    inside = (np.abs(points - (320, 180)) < (115, 75)).all(axis=1)  # not at the mask's edge
    assert len(points) > 20
    assert not inside.any()


def test_harris_rejects_points_on_a_strong_edge_that_gftt_accepts():
    """Harris and Stephens (1988): det - k trace² is negative where one gradient dominates."""
    frame = np.full((120, 160), 20, np.uint8)
    frame[:, 80:] = 220
    frame[50:70, 80:90] = 200  # a faint rectangle that touches the edge with its left side
    gftt, harris = (KeypointGenerator(name)(frame, None) for name in ("gftt", "harris"))
    assert set(gftt[:, 0]) == {81}
    assert set(harris[:, 0]) == {89}
