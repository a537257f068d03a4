from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.sets_on_disk import scene
from ssiam.training.crops import Window, crop_mask, crop_picture, mask_cells, window_around


def extent(coverage):
    """Centre from the middle pixel, width, height of what is covered, by its sums."""
    side = coverage.shape[0]
    share = coverage / 255
    across, down = share.max(axis=0), share.max(axis=1)
    places = np.arange(side) - (side - 1) / 2
    return np.array(
        [
            (places * across).sum() / across.sum(),
            (places * down).sum() / down.sum(),
            across.sum(),
            down.sum(),
        ]
    )


def mask_with(box):
    mask = np.zeros((400, 400), bool)
    x, y, w, h = box
    mask[y : y + h, x : x + w] = True
    return mask


@settings(max_examples=60, deadline=None)
@given(
    box=st.tuples(*[st.integers(150, 200)] * 2, *[st.integers(24, 60)] * 2),
    shift=st.tuples(*[st.floats(-12, 12)] * 2),
    scale=st.floats(0.8, 1.3),
    stretch=st.floats(0.9, 1.1),
    mirrored=st.booleans(),
)
def test_a_drawn_box_is_where_the_window_says(box, shift, scale, stretch, mirrored):
    around = window_around(box, 255)
    x, y = np.add(around.center_xy, shift).tolist()
    window = Window((x, y), around.side * scale, 255, stretch=stretch, mirrored=mirrored)
    found = extent(crop_mask(mask_with(box), window))
    np.testing.assert_allclose(found, window.seen(box), atol=0.5)


def test_the_target_fills_the_middle_half_of_the_template():
    window = window_around((100, 80, 50, 50), 127)
    np.testing.assert_allclose(window.seen((100, 80, 50, 50)), (0, 0, 63.5, 63.5))
    search = window_around((100, 80, 50, 50), 255)
    np.testing.assert_allclose(search.seen((100, 80, 50, 50)), (0, 0, 63.5, 63.5))


def test_a_turned_window_keeps_the_centre():
    window = replace(window_around((100, 80, 30, 30), 255), angle=0.1, center_xy=(110.0, 90.0))
    coverage = crop_mask(mask_with((100, 80, 30, 30)), window).astype(float)
    rows, columns = np.indices(coverage.shape) - 127
    centre = (columns * coverage).sum(), (rows * coverage).sum()
    np.testing.assert_allclose(
        np.divide(centre, coverage.sum()), window.seen((100, 80, 30, 30))[:2], atol=0.2
    )


def test_mask_cells_lie_under_the_box():
    box = (160, 170, 48, 36)
    window = window_around(box, 255)
    cells = mask_cells(crop_mask(mask_with(box), window))
    assert cells.shape == (64, 64)
    assert cells.max() == 255
    assert (cells > 0).sum() > (cells == 255).sum()  # what is covered in part
    rows, columns = np.nonzero(cells >= 128)
    cx, cy, w, h = window.seen(box)
    # Cell (i, j) covers the pixels 4 i to 4 i + 3 and 4 j to 4 j + 3.
    assert abs(4 * columns.min() - (127 + cx - w / 2)) <= 2.5
    assert abs(4 * columns.max() + 4 - (128 + cx + w / 2)) <= 2.5
    assert abs(4 * rows.min() - (127 + cy - h / 2)) <= 2.5
    assert abs(4 * rows.max() + 4 - (128 + cy + h / 2)) <= 2.5


def test_outside_is_the_mean_colour_or_what_lies_behind():
    image = scene(seed=3)
    window = Window((0.0, 0.0), 400.0, 255)
    assert np.abs(crop_picture(image, window)[0, 0] - image.mean(axis=(0, 1))).max() < 1
    behind = np.full((255, 255, 3), 250, np.uint8)
    crop = crop_picture(image, window, behind)
    assert (crop[:120, :120] == 250).all()
    assert (crop[140:, 140:250] < 70).all()
    assert (behind == 250).all()


@pytest.mark.parametrize(
    ("box", "hidden"),
    [((100, 100, 40, 40), False), ((400, 100, 40, 40), True), ((228, 100, 40, 40), False)],
    ids=["in the middle", "far off", "at the edge"],
)
def test_a_window_knows_what_it_hides(box, hidden):
    window = Window((120.0, 120.0), 255.0, 255)
    assert window.hides(box) is hidden
    assert crop_mask(np.pad(mask_with(box), (0, 99)), window).any() != hidden


def test_a_window_knows_whether_the_picture_fills_it():
    assert Window((127.0, 127.0), 255.0, 255).is_within((255, 255))
    assert not Window((128.5, 127.0), 255.0, 255).is_within((255, 255))
