"""Cells of an image: where they are sampled, how they move, and the texture of each."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import generator
from ssiam.geometry import rigid
from ssiam.motion.cells import CellTemplate, Grid
from ssiam.motion.models import FREEDOM, small_transform

# A unit is 40 px, and (0, 0) is the pixel (39.5, 19.5).
PIXEL_FROM_UNIT = np.array([[40.0, 0, 39.5], [0, 40, 19.5], [0, 0, 1]])


def grid(stride=2, side=4, size=(80, 40), model="rigid"):
    return Grid(size, PIXEL_FROM_UNIT, stride, side, model)


@pytest.mark.parametrize(
    ("size", "stride", "side", "shape"),
    [
        ((80, 40), 2, 4, (5, 10)),
        ((80, 40), 1, 5, (8, 16)),
        ((79, 39), 2, 4, (4, 9)),  # samples begin at pixel 1
        ((80, 40), 3, 4, (3, 6)),
        ((81, 41), 2, 4, (5, 10)),
        ((9, 9), 2, 4, (1, 1)),
        ((8, 8), 2, 4, (1, 1)),
        ((7, 80), 2, 4, (10, 0)),
    ],
)
def test_whole_cells_fit_into_the_image(size, stride, side, shape):
    found = grid(stride, side, size)
    assert found.shape == shape
    assert found.cells == shape[0] * shape[1]


def test_samples_are_the_pixels_of_each_cell():
    image = np.arange(80 * 40, dtype=np.float32).reshape(40, 80)
    found = grid().samples([image, -image])
    assert found.shape == (2, 16, 50)
    assert found.dtype == np.float32
    for cell in (0, 3, 10, 49):
        row, column = divmod(cell, 10)
        rows = 1 + 2 * (4 * row + np.arange(4))
        columns = 1 + 2 * (4 * column + np.arange(4))
        np.testing.assert_array_equal(found[0, :, cell], image[np.ix_(rows, columns)].ravel())
    np.testing.assert_array_equal(found[1], -found[0])


def test_centers_in_units():
    """The center of a cell of even side is the sample right and below of its middle."""
    found = grid()
    assert found.centers.shape == (2, 50)
    for cell in (0, 3, 10, 49):
        row, column = divmod(cell, 10)
        pixel = np.array([1 + 2 * (4 * column + 2), 1 + 2 * (4 * row + 2)])
        np.testing.assert_allclose(found.centers[:, cell], (pixel - (39.5, 19.5)) / 40)
    assert found.pixels_per_unit == 40


def test_warped_samples_are_those_at_the_mapped_positions():
    """The image is a ramp, so that any position can be read from it."""
    x, y = np.meshgrid(np.arange(80, dtype=np.float32), np.arange(40, dtype=np.float32))
    shift = rigid(0.1, -0.05, 0.0)  # units: 4 and -2 px
    inner = [int(cell) for cell in range(50) if 1 <= cell // 10 <= 3 and 1 <= cell % 10 <= 8]
    for image, offset in ((x, 4), (y, -2)):
        samples, warped = grid().samples([image])[0], grid().warped(image, shift)
        assert warped.shape == (16, 50)
        np.testing.assert_allclose(warped[:, inner], samples[:, inner] + offset, atol=1e-4)


def test_a_homography_is_warped_with_its_tilt():
    x, _ = np.meshgrid(np.arange(80, dtype=np.float32), np.arange(40, dtype=np.float32))
    tilt = np.array([[1.0, 0, 0], [0, 1, 0], [0.1, 0, 1]])
    warped = grid(model="homography").warped(x, tilt)
    samples = (grid().samples([x])[0] - 39.5) / 40
    expected = 39.5 + 40 * samples / (1 + 0.1 * samples)
    inner = slice(21, 29)
    np.testing.assert_allclose(warped[:, inner], expected[:, inner], atol=0.04)


@pytest.mark.parametrize("model", FREEDOM)
def test_the_flow_is_how_far_centers_move_for_a_step(model):
    found = grid(model=model)
    freedom = FREEDOM[model]
    assert found.flow.shape == (freedom, 100)
    assert found.flow.dtype == found.flow_products.dtype == np.float32
    homogeneous = np.vstack([found.centers, np.ones(50)])
    for index in range(freedom):
        step = np.zeros(freedom)
        step[index] = 1e-6
        mapped = small_transform(step) @ homogeneous
        moved = (mapped[:2] / mapped[2] - found.centers) / 1e-6
        np.testing.assert_allclose(found.flow[index], (40 * moved / 8).ravel(), atol=1e-4)
    fx, fy = found.flow.reshape(freedom, 2, 50).swapaxes(0, 1)
    xx, xy, yy = found.flow_products.reshape(freedom, freedom, 3, 50).transpose(2, 0, 1, 3)
    for i in range(freedom):
        for j in range(freedom):
            np.testing.assert_allclose(xx[i, j], fx[i] * fx[j], rtol=1e-4, atol=1e-4)
            np.testing.assert_allclose(xy[i, j], fx[i] * fy[j] + fy[i] * fx[j], atol=1e-3)
            np.testing.assert_allclose(yy[i, j], fy[i] * fy[j], rtol=1e-4, atol=1e-4)


def units(*pixels):
    """A box of pixels in units: low xy, high xy."""
    return (np.array(pixels, float) - [39.5, 19.5, 39.5, 19.5]) / 40


def test_background_share():
    """Cells are 8 by 8 px; the first one begins at pixel 1."""
    found = grid()
    assert (found.background_share(np.empty((0, 4))) == 1).all()
    shares = []
    for right in (3, 4.9, 5.1, 9):
        share = found.background_share(units(1, 1, right, 9)[None])
        shares.append(share[0])
        np.testing.assert_allclose(share[1:], 1, atol=1e-6)
    assert shares == pytest.approx([0.75, 0.5125, 0, 0])
    lower = found.background_share(units(1, 7, 9, 9)[None])
    assert lower[0] == pytest.approx(0.75)
    np.testing.assert_allclose(lower[1:], 1, atol=1e-6)
    two = found.background_share(np.stack([units(1, 1, 3, 9), units(1, 1, 9, 3)]))
    assert two[0] == pytest.approx(0.75 * 0.75)
    np.testing.assert_allclose(two[1:], 1, atol=1e-6)
    assert two.dtype == np.float32


def test_a_box_over_several_cells():
    share = grid().background_share(units(17, 9, 41, 25)[None]).reshape(5, 10)
    expected = np.ones((5, 10))
    expected[1:3, 2:5] = 0
    np.testing.assert_allclose(share, expected, atol=1e-6)


def test_means_of_cells():
    samples = generator(1).normal(100, 20, (16, 50)).astype(np.float32)
    found = grid()
    np.testing.assert_allclose(found.mean(samples), samples.mean(axis=0), rtol=1e-5)
    stacked = np.stack([samples, 2 * samples])
    np.testing.assert_allclose(found.mean(stacked), stacked.mean(axis=1), rtol=1e-5)
    centered = found.center(samples.copy())
    np.testing.assert_allclose(centered, samples - samples.mean(axis=0), atol=1e-4)


def test_share_of_a_mask():
    mask = np.zeros((40, 80), np.uint8)
    mask[:8, :8] = 255
    mask[:8, 8:12] = 255
    share = grid().mask_share(mask)
    assert share[:3] == pytest.approx([1, 0.5, 0])
    assert not share[3:].any()


def test_a_template_is_relative_to_the_mean_of_each_cell():
    image = generator(2).integers(0, 256, (40, 80)).astype(np.uint8)
    found = grid()
    template = CellTemplate(image, found)
    raw = found.samples([*cv2.spatialGradient(image), image])
    expected = raw - raw.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(template.values, expected[2], atol=1e-3)
    np.testing.assert_allclose(template.gradients, expected[:2], atol=1e-2)
    gx, gy = template.gradients.astype(float)
    products = [(gx * gx).sum(axis=0), (gx * gy).sum(axis=0), (gy * gy).sum(axis=0)]
    np.testing.assert_allclose(template.products, products, rtol=1e-3, atol=10)
    np.testing.assert_allclose(template.texture, template.values.var(axis=0), rtol=1e-4)
    assert template.textured.all()


def test_textured_cells_have_a_variance_above_one():
    image = np.full((40, 80), 100, np.uint8)
    image[1:8:2, 1:8:4] = 102  # two columns of samples in the first cell: variance 1
    image[1:8:2, 9:16:4] = 103
    template = CellTemplate(image, grid())
    assert template.texture[:3] == pytest.approx([1, 2.25, 0])
    assert template.textured.tolist() == [False, True] + [False] * 48


def test_the_change_to_a_later_image_is_the_mean_square():
    first = np.full((40, 80), 100, np.uint8)
    second = first.copy()
    second[1:8:2, 1:8:4] = 104  # relative to the mean: 2 or -2 everywhere
    second[:8, 8:16] = 150  # brighter as a whole
    change = CellTemplate(first, grid()).change_to(CellTemplate(second, grid()))
    assert change[:3] == pytest.approx([4, 0, 0])
