"""The coarse estimate: block matching, and which cells decide."""

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest

from helpers.synthetic import world
from ssiam.geometry import rigid
from ssiam.motion import coarse, direct
from ssiam.motion.alignment import AlignmentSettings
from ssiam.motion.cells import CellTemplate, Grid
from ssiam.motion.coarse import CoarseEstimator, _block_shift
from ssiam.motion.direct import OverlayDetector
from ssiam.motion.pyramid import PyramidBuilder

TINY = cv2.cvtColor(world(6, (120, 90)), cv2.COLOR_BGR2GRAY)


def cut(x, y, size=(40, 24)):
    return np.ascontiguousarray(TINY[y : y + size[1], x : x + size[0]])


@pytest.mark.parametrize("size", [(40, 24), (24, 40), (40, 40)])
@pytest.mark.parametrize("shift", [(0, 0), (3, -2), (-7, 5), (8, 8)])
def test_a_shift_of_blocks(size, shift):
    """The range is a quarter of the longer side."""
    dx, dy = shift
    prev, cur = cut(30, 20, size), cut(30 - dx, 20 - dy, size)
    assert _block_shift(prev, cur, np.ones((9, 16), np.float32)) == shift


def test_blocks_without_background_are_not_used():
    prev = cut(30, 20)
    cur = cut(30, 17)
    cur[:, 10:] = cut(30, 22)[:, 10:]  # three columns of blocks move elsewhere
    background = np.ones((12, 20), np.float32)
    assert _block_shift(prev, cur, background) == (0, -2)
    background[:, 5:] = 0
    assert _block_shift(prev, cur, background) == (0, 3)
    background[:, 5:] = 0.49
    assert _block_shift(prev, cur, background) == (0, 3)
    background[:, 5:] = 0.51
    assert _block_shift(prev, cur, background) == (0, -2)
    assert _block_shift(prev, cur, np.zeros((12, 20), np.float32)) == (0, 0)


def test_settings_are_the_measured_ones():
    excluded = AlignmentSettings(1.0, 0.3, 0.5, 8, 2e-3, 1.0)
    assert excluded == coarse._WITH_EXCLUSION
    assert AlignmentSettings(1.0, 0.3, 1.0, 16, 1e-3, 0.8) == coarse._WITHOUT_EXCLUSION
    assert AlignmentSettings(2.0, 0.3, 0.3, 4, 5e-5) == direct._WITH_EXCLUSION
    assert replace(direct._WITH_EXCLUSION, evenness=1.0, tolerance=0.1) == direct._WITHOUT_EXCLUSION


SIZE = (640, 360)
NO_BOXES = np.empty((0, 4))


class Pair:
    """Two frames as the estimator gets them."""

    def __init__(self, prev, cur):
        builder = PyramidBuilder(SIZE)
        self.estimator = CoarseEstimator(builder)
        pyramids = [builder.from_frame(frame) for frame in (prev, cur)]
        self.pairs = [(each, self.estimator.grid.template(each.coarse)) for each in pyramids]

    def shift(self, boxes=NO_BOXES, visible=None, scene=None):
        """dx and dy of the center, px of the frame."""
        visible = np.ones((20, 36), np.float32) if visible is None else visible
        found = self.estimator.estimate(*self.pairs, np.asarray(boxes), visible, scene)
        return found[:2, 2] * 320


SCENE = world(3, (960, 540))


def frame(dx, dy, object_at=None):
    image = np.ascontiguousarray(SCENE[90 - dy : 450 - dy, 160 - dx : 800 - dx])
    if object_at is not None:
        x, y = object_at
        image[y : y + 280, x : x + 420] = world(9)[:280, :420]
    return image


def test_the_grid_has_cells_of_five_pixels_at_80():
    grid = CoarseEstimator(PyramidBuilder(SIZE)).grid
    assert grid.shape == (9, 16)
    assert grid.model == "rigid"


@pytest.mark.parametrize("shift", [(0, 0), (6, -4), (-40, 25), (130, -60)])
def test_small_shifts_and_jumps(shift):
    assert Pair(frame(0, 0), frame(*shift)).shift() == pytest.approx(shift, abs=1.0)


def test_a_large_object_is_not_followed_if_it_is_excluded():
    """It covers half of the frame and moves to the right, the scene to the left."""
    prev, cur = frame(0, 0, (100, 40)), frame(-24, 8, (130, 40))
    box = [[(100 - 320) / 320, (40 - 180) / 320, (520 - 320) / 320, (320 - 180) / 320]]
    assert Pair(prev, cur).shift(box) == pytest.approx((-24, 8), abs=1.5)


def test_hidden_cells_are_not_used():
    prev, cur = frame(0, 0, (100, 40)), frame(-24, 8, (130, 40))
    visible = np.ones((20, 36), np.float32)
    visible[2:19, 5:31] = 0
    assert Pair(prev, cur).shift(visible=visible) == pytest.approx((-24, 8), abs=1.5)
    scene = np.ones((9, 16), np.float32)
    scene[1:8, 2:14] = 0
    assert Pair(prev, cur).shift(scene=scene.ravel()) == pytest.approx((-24, 8), abs=1.5)


def test_without_any_cell_the_motion_is_none():
    pair = Pair(frame(0, 0), frame(40, 0))
    found = pair.shift(scene=np.zeros(144, np.float32))
    assert found == pytest.approx((0, 0), abs=1e-6)


GRID = Grid((80, 40), np.array([[40.0, 0, 39.5], [0, 40, 19.5], [0, 0, 1]]), 2, 4, "rigid")


def textured(seed):
    return np.random.default_rng(seed).integers(60, 200, (40, 80)).astype(np.uint8)


MOVED = rigid(0.03, 0, 0)  # 1.2 px
HARDLY_MOVED = rigid(0.02, 0, 0)  # .8 px


def overlays(frames, motion=MOVED, error=1e4):
    """Whether each of the 50 cells is background after some frames."""
    detector = OverlayDetector(GRID)
    templates = [CellTemplate(image, GRID) for image in frames]
    for prev, cur in pairwise(templates):
        detector.update(prev, cur, motion, np.full(50, error, np.float32))
    return detector.background


def still_cell(count, cell=13, change=0.0):
    """Images that change everywhere but in one cell; by `change` gray levels there."""
    images = [textured(seed) for seed in range(count)]
    row, column = divmod(cell, 10)
    part = np.s_[1 + 8 * row : 9 + 8 * row : 2, 1 + 8 * column : 9 + 8 * column : 2]
    for index, image in enumerate(images):
        image[part] = images[0][part]
        image[part][::2] += np.uint8(change) * (index % 2)
    return images


@pytest.mark.parametrize(("frames", "found"), [(2, False), (3, False), (4, True), (9, True)])
def test_a_cell_that_stays_for_three_frames_is_an_overlay(frames, found):
    background = overlays(still_cell(frames))
    expected = np.ones(50)
    expected[13] = not found
    np.testing.assert_array_equal(background, expected)
    assert background.dtype == np.float32


def test_the_scene_must_move_by_a_pixel():
    assert overlays(still_cell(9), HARDLY_MOVED).all()
    assert overlays(still_cell(9), np.eye(3)).all()


def test_a_cell_that_the_motion_explains_as_well_is_no_overlay():
    images = still_cell(9, change=10.0)
    change = CellTemplate(images[0], GRID).change_to(CellTemplate(images[1], GRID))[13]
    assert overlays(images, error=2.1 * change)[13] == 0
    assert overlays(images, error=1.9 * change)[13] == 1


@pytest.mark.parametrize("share", [0.2, 0.3])
def test_a_static_cell_differs_by_at_most_a_fourth_of_its_texture(share):
    texture = CellTemplate(still_cell(2)[0], GRID).texture[13]
    images = still_cell(2, change=round(2 * np.sqrt(share * texture)))
    detector = OverlayDetector(GRID)
    prev, cur = (CellTemplate(image, GRID) for image in images)
    detector.update(prev, cur, MOVED, np.full(50, 1e4, np.float32))
    assert detector._evidence[13] == (0.25 if share < 0.25 else 0)


def test_an_overlay_that_changes_is_background_again():
    images = still_cell(9)
    assert overlays([*images, textured(99)])[13] == 1
    assert overlays([*images[:3], textured(99), *images[:3]])[13] == 1


def test_cells_without_texture_are_no_overlay():
    images = still_cell(9)
    for image in images:
        image[8:16, 24:33] = 100
    assert overlays(images).all()
