"""Each keypoint generator finds what its name promises, and enough of it."""

from itertools import product

import cv2
import numpy as np
import pytest

from helpers.synthetic import generator, world
from ssiam import CameraMotion
from ssiam.errors import ArgumentError
from ssiam.geometry import map_points, rigid
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


def frames_with_a_textured_object(shift):
    """Two frames of a scene that shifts, and of an object with more corners that does not."""
    rng = generator(1)
    scene = np.full((SIZE[1], SIZE[0], 3), 100, np.uint8)
    for x, y in product(range(20, SIZE[0], 70), range(20, SIZE[1], 60)):
        corner = (x + int(rng.integers(6, 12)), y + int(rng.integers(6, 12)))
        cv2.rectangle(scene, (x, y), corner, rng.uniform(140, 230, 3).tolist(), -1)
    moved = cv2.warpAffine(scene, rigid(shift, 0, 0)[:2], SIZE, borderMode=cv2.BORDER_REFLECT_101)
    squares = 255 * rng.integers(0, 2, (20, 20, 1)).astype(np.uint8)
    for frame in (scene, moved):
        frame[100:260, 240:400] = np.kron(squares, np.ones((8, 8, 1), np.uint8))
    return scene, moved


@pytest.mark.parametrize("name", ["gftt", "brisk"])
def test_evenly_spread_keypoints_follow_the_scene_and_not_its_most_textured_part(name):
    shift, shifts = 9.0, []
    for spread in (True, False):
        camera = CameraMotion(name, model="rigid", spread=spread)
        for frame in frames_with_a_textured_object(shift):
            motion = camera.update(frame)
        shifts.append(map_points(motion.cur_from_prev, [(60.0, 60.0)])[0, 0] - 60)
    assert shifts == pytest.approx([shift, 0], abs=0.1)


def test_spread_is_on_or_off():
    with pytest.raises(ArgumentError, match=r"^spread is 1: it must be True or False"):
        CameraMotion("orb", spread=1)
