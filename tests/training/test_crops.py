from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.sets_on_disk import scene
from ssiam.training.data.crops import (
    CropRegion,
    crop_image,
    crop_mask,
    excludes,
    region_around,
)


def extent(coverage):
    """cx, cy, w, h of the covered rectangle from its sums, px from the middle pixel."""
    side = coverage.shape[0]
    fraction = coverage / 255
    across, down = fraction.max(axis=0), fraction.max(axis=1)
    positions = np.arange(side) - (side - 1) / 2
    return np.array(
        [
            (positions * across).sum() / across.sum(),
            (positions * down).sum() / down.sum(),
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
def test_the_mapped_box_is_where_the_crop_shows_it(box, shift, scale, stretch, mirrored):
    around = region_around(box, 255)
    x, y = np.add(around.center_xy, shift).tolist()
    region = CropRegion((x, y), around.side * scale, 255, stretch=stretch, mirrored=mirrored)
    found = extent(crop_mask(mask_with(box), region))
    np.testing.assert_allclose(found, region.box_in_crop(box), atol=0.5)


def test_the_target_fills_the_middle_half_of_the_template():
    template = region_around((100, 80, 50, 50), 127)
    np.testing.assert_allclose(template.box_in_crop((100, 80, 50, 50)), (0, 0, 63.5, 63.5))
    search = region_around((100, 80, 50, 50), 255)
    np.testing.assert_allclose(search.box_in_crop((100, 80, 50, 50)), (0, 0, 63.5, 63.5))


def test_a_rotated_region_maps_the_center():
    box = (100, 80, 30, 30)
    region = replace(region_around(box, 255), angle=0.1, center_xy=(110.0, 90.0))
    coverage = crop_mask(mask_with(box), region).astype(float)
    rows, columns = np.indices(coverage.shape) - 127
    center = (columns * coverage).sum(), (rows * coverage).sum()
    np.testing.assert_allclose(
        np.divide(center, coverage.sum()), region.box_in_crop(box)[:2], atol=0.2
    )


def test_the_outside_is_the_mean_color_or_the_background():
    image = scene(seed=3)
    region = CropRegion((0.0, 0.0), 400.0, 255)
    assert np.abs(crop_image(image, region)[0, 0] - image.mean(axis=(0, 1))).max() < 1
    background = np.full((255, 255, 3), 250, np.uint8)
    crop = crop_image(image, region, background)
    assert (crop[:120, :120] == 250).all()
    assert (crop[140:, 140:250] < 70).all()
    assert (background == 250).all()


@pytest.mark.parametrize(
    ("box", "excluded"),
    [((100, 100, 40, 40), False), ((400, 100, 40, 40), True), ((228, 100, 40, 40), False)],
    ids=["in the middle", "far outside", "at the edge"],
)
def test_a_region_excludes_boxes_outside_of_its_crop(box, excluded):
    region = CropRegion((120.0, 120.0), 255.0, 255)
    assert excludes(region, box, margin=0.0) is excluded
    assert crop_mask(np.pad(mask_with(box), (0, 99)), region).any() != excluded


def test_a_region_within_the_frame():
    assert CropRegion((127.0, 127.0), 255.0, 255).is_within((255, 255))
    assert not CropRegion((128.5, 127.0), 255.0, 255).is_within((255, 255))
