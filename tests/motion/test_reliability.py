"""When a directly aligned motion is reliable, and which cells it uses."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import world
from ssiam.geometry import rigid
from ssiam.motion.alignment import Alignment
from ssiam.motion.direct import DirectMotion

SIZE = (640, 360)
NONE = np.empty((0, 4))
SCENE = world(3, (960, 540))


def frame(dx=0, dy=0):
    return np.ascontiguousarray(SCENE[90 - dy : 450 - dy, 160 - dx : 800 - dx])


@pytest.fixture(scope="module")
def prepared():
    """An estimator with a previous frame."""
    motion = DirectMotion(SIZE, "rigid")
    motion.set_previous(frame())
    return motion


def checked(prepared, explained, transform=None, share=None):
    """The motion if these shares (rows, columns) of the texture of the cells are explained."""
    template = prepared._prev.fine
    error = (1 - explained.ravel()) * (template.texture + 1e-3)
    share = np.ones(prepared._grid.cells, np.float32) if share is None else share.ravel()
    transform = np.eye(3) if transform is None else transform
    return prepared._checked(template, Alignment(transform, error), share)


def explained_in(shape, rows, columns, value=1.0):
    explained = np.zeros(shape)
    explained[rows, columns] = value
    return explained


def test_the_grid_has_cells_of_16_pixels_at_320(prepared):
    assert prepared._grid.shape == (11, 20)
    assert prepared._grid.pixels_per_unit == 160
    assert prepared._prev.fine.textured.all()


@pytest.mark.parametrize(("share", "reliable"), [(0.26, True), (0.24, False)])
def test_a_fourth_of_the_texture_is_explained(prepared, share, reliable):
    """In some cells wholly, and in the others to the rest of the share."""
    explained = np.full((11, 20), (share - 0.1) / 0.9)
    explained[:, :2] = 1
    motion = checked(prepared, explained)
    assert motion.reliable is reliable
    assert motion.size_wh == SIZE
    if reliable:
        assert motion.inliers == pytest.approx(share)


@pytest.mark.parametrize(("count", "reliable"), [(8, True), (7, False)])
def test_eight_cells_agree(prepared, count, reliable):
    explained = np.full((11, 20), 0.49)
    explained[5, :count] = 0.51
    assert checked(prepared, explained).reliable is reliable


@pytest.mark.parametrize(
    ("rows", "columns", "reliable"),
    [
        (slice(0, 4), slice(0, 4), True),  # 48 px of 160 along both
        (slice(0, 3), slice(0, 3), False),
        (slice(5, 6), slice(0, 20), True),
        (slice(0, 11), slice(7, 8), True),
        (slice(8, 11), slice(17, 20), False),
    ],
)
def test_cells_that_agree_are_spread(prepared, rows, columns, reliable):
    explained = np.full((11, 20), 0.49)
    explained[rows, columns] = 0.51
    assert checked(prepared, explained).reliable is reliable


def test_a_cell_agrees_by_its_share_and_texture(prepared):
    """Cells that are hidden, or worse than without a motion, count nothing."""
    explained = np.full((11, 20), 0.6)
    hidden = np.ones((11, 20), np.float32)
    hidden[:, 10:] = 0
    explained[:, 10:] = -5
    assert checked(prepared, explained, share=hidden).inliers == pytest.approx(0.6)
    assert checked(prepared, explained).inliers == pytest.approx(0.3)


def test_an_implausible_motion_is_not_reliable(prepared):
    for dx, reliable in ((0.59, True), (0.61, False)):  # units: of 320 px
        motion = checked(prepared, np.ones((11, 20)), rigid(dx, 0, 0))
        assert motion.reliable is reliable
    assert motion.inliers == 0


def test_motions_are_in_pixels_of_the_frame(prepared):
    motion = checked(prepared, np.ones((11, 20)), rigid(0.1, -0.05, 0.02))
    assert motion.shift_angle == pytest.approx((32, -16, 0.02))


def estimated(first, second, boxes=NONE):
    motion = DirectMotion(SIZE, "rigid")
    motion.set_previous(first)
    return motion.estimate(second, np.asarray(boxes, float))


def test_the_first_frame_has_no_motion():
    motion = DirectMotion(SIZE, "rigid")
    found = motion.estimate(frame(), NONE)
    assert (found.reliable, found.inliers, found.size_wh) == (True, 1, SIZE)
    assert motion.estimate(frame(8, -4), NONE).shift_angle[:2] == pytest.approx((8, -4), abs=0.1)


def test_a_blank_frame_is_skipped():
    motion = DirectMotion(SIZE, "rigid")
    motion.set_previous(frame())
    blank = motion.estimate(np.full_like(frame(), 80), NONE)
    assert (blank.reliable, blank.size_wh) == (False, SIZE)
    assert motion.estimate(frame(8, -4), NONE).shift_angle[:2] == pytest.approx((8, -4), abs=0.1)


def test_frames_that_are_too_small_have_no_motion():
    motion = DirectMotion((700, 3), "rigid")
    tiny = np.zeros((3, 700, 3), np.uint8)
    motion.set_previous(tiny)
    found = motion.estimate(tiny, NONE)
    assert (found.reliable, found.size_wh) == (False, (700, 3))


def test_the_pixels_in_a_box_are_not_used():
    first, second = frame(), frame(6, 2)
    patch = world(9)
    first[60:300, 100:500] = patch[:240, :400]
    second[60:300, 84:484] = patch[:240, :400]
    box = [100, 60, 500, 300]
    assert estimated(first, second, [box]).shift_angle[:2] == pytest.approx((6, 2), abs=0.2)


def circular(image, radius=150):
    inside = np.zeros(image.shape[:2], np.uint8)
    cv2.circle(inside, (320, 180), radius, 1, -1)
    return image * inside[..., None]


def test_cells_outside_of_a_circular_scene_are_not_used():
    motion = DirectMotion(SIZE, "rigid")
    motion.set_previous(circular(frame()))
    data = motion._prev
    assert set(np.unique(data.scene)) == set(np.unique(data.coarse_scene)) == {0, 1}
    assert data.scene.dtype == data.coarse_scene.dtype == np.float32
    x, y = np.hypot(*motion._grid.centers[:, data.scene > 0]), motion._grid.centers
    assert x.max() < 150 / 320
    inner = np.hypot(*y) < (150 - 36) / 320
    assert data.scene[inner].all()
    outside = np.hypot(*motion._grid.centers) > 160 / 320
    assert not data.scene[outside].any()
    coarse = motion._coarse.grid.centers
    assert not data.coarse_scene[np.hypot(*coarse) > 160 / 320].any()
    assert data.coarse_scene[np.hypot(*coarse) < 100 / 320].all()
    mean = data.pyramid.fine[90, 20]
    assert 60 < mean < 200, "the area has the mean of the scene"
    found = motion.estimate(circular(frame(8, -4)), NONE)
    assert found.shift_angle[:2] == pytest.approx((8, -4), abs=0.2)


def test_without_a_flat_area_all_cells_are_used(prepared):
    assert prepared._prev.scene is None
    assert prepared._prev.coarse_scene is None


def test_a_flat_area_that_leaves_too_few_cells_is_used():
    motion = DirectMotion(SIZE, "rigid")
    motion.set_previous(circular(frame(), radius=24))
    assert motion._prev.scene is None
