"""Robust alignment to cells: its weights, its steps and when it ends."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.synthetic import world
from ssiam.motion import alignment
from ssiam.motion.alignment import AlignmentSettings, agreement, align
from ssiam.motion.cells import CellTemplate, Grid

PIXEL_FROM_UNIT = np.array([[80.0, 0, 79.5], [0, 80, 44.5], [0, 0, 1]])
SETTINGS = AlignmentSettings(
    noise=2.0, tolerance=0.3, evenness=0.5, max_iterations=8, min_step=1e-4
)


def test_the_tolerated_error_grows_with_the_texture():
    texture = np.array([0.0, 10.0, 100.0])
    assert SETTINGS.tolerated(texture) == pytest.approx([4, 7, 34])
    assert replace(SETTINGS, noise=3.0).tolerated(texture)[0] == 9


def test_the_tolerance_is_tightened_to_a_twentieth():
    assert SETTINGS.tightened() == SETTINGS
    settings = replace(SETTINGS, tightening=0.5)
    found = []
    for _ in range(4):
        settings = settings.tightened()
        found.append(settings.tolerance)
    assert found == pytest.approx([0.15, 0.075, 0.05, 0.05])
    assert settings.tightening == 0.5


def test_at_the_tolerated_error_the_agreement_is_a_quarter():
    found = agreement(np.array([0.0, 5.0, 10.0, 15.0]), np.full(4, 5.0))
    assert found == pytest.approx([1, 1 / 4, 1 / 9, 1 / 16])


@pytest.fixture(scope="module")
def images():
    """Two images, of which the second is shifted by (2, 1) px."""
    scene = world(2, (320, 180))[::1, :, 1]
    return (
        np.ascontiguousarray(scene[40:130, 60:220]),
        np.ascontiguousarray(scene[39:129, 58:218]),
    )


def template(image, side=5):
    return CellTemplate(image, Grid((160, 90), PIXEL_FROM_UNIT, 1, side, "rigid"))


def aligned(images, settings=SETTINGS, start=None, share=None):
    made = template(images[0])
    start = np.eye(3) if start is None else start
    share = np.ones(made.grid.cells, np.float32) if share is None else share
    return made, align(made, images[1], start, share, settings)


def test_a_shift_is_found(images):
    made, found = aligned(images)
    shift = found.cur_from_prev[:2, 2] * 80
    assert shift == pytest.approx((2, 1), abs=0.02)
    assert np.median(found.error) < 0.05 * np.median(made.texture)
    assert found.error.shape == (made.grid.cells,)


def test_the_error_is_that_of_the_last_transform_but_one(images):
    """The variance of the difference in each cell."""
    settings = replace(SETTINGS, max_iterations=1)
    made, found = aligned(images, settings)
    residual = made.grid.warped(images[1].astype(np.float32), np.eye(3)) - made.values
    np.testing.assert_allclose(found.error, residual.var(axis=0), rtol=1e-4, atol=0.05)


def test_cells_without_a_share_are_not_used(images):
    """The upper half shows another shift."""
    first, second = images
    mixed = second.copy()
    mixed[:45] = np.roll(first[:45], -3, axis=1)
    share = np.ones((18, 32), np.float32)
    share[:10] = 0
    _, found = aligned((first, mixed), share=share.ravel())
    assert found.cur_from_prev[:2, 2] * 80 == pytest.approx((2, 1), abs=0.03)
    share = 1 - share
    share[9:] = 0
    _, found = aligned((first, mixed), share=share.ravel())
    assert found.cur_from_prev[0, 2] * 80 == pytest.approx(-3, abs=0.3)


def counted(monkeypatch):
    steps = []
    compute = alignment._steps
    monkeypatch.setattr(
        alignment, "_steps", lambda *given: steps.append(compute(*given)) or steps[-1]
    )
    return steps


@pytest.mark.parametrize("count", [1, 3, 8])
def test_the_number_of_iterations_is_limited(images, monkeypatch, count):
    steps = counted(monkeypatch)
    aligned(images, replace(SETTINGS, max_iterations=count, min_step=0.0))
    assert len(steps) == count


def test_it_ends_after_a_small_step(images, monkeypatch):
    steps = counted(monkeypatch)
    aligned(images, replace(SETTINGS, max_iterations=50, min_step=1e-3))
    sizes = [np.abs(step).sum() for step in steps]
    assert len(sizes) < 50
    assert sizes[-1] < 1e-3
    assert min(sizes[:-1]) >= 1e-3


def weights(images, monkeypatch, settings, count=2):
    """The weights of the cells in each iteration."""
    found = []
    compute = alignment._steps

    def recording(made, residual, weight):
        found.append((np.array(residual), np.array(weight)))
        return compute(made, residual, weight)

    monkeypatch.setattr(alignment, "_steps", recording)
    made, _ = aligned(images, replace(settings, max_iterations=count, min_step=0.0))
    return made, found


@pytest.mark.parametrize("evenness", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("tightening", [1.0, 0.5])
def test_weights_of_cells(images, monkeypatch, evenness, tightening):
    settings = replace(SETTINGS, evenness=evenness, tightening=tightening)
    made, found = weights(images, monkeypatch, settings)
    tolerance = 0.3
    for residual, weight in found:
        error = residual.var(axis=0)
        tolerated = 4 + tolerance * made.texture
        expected = (made.texture + 4) ** -evenness * (tolerated / (tolerated + error)) ** 2
        np.testing.assert_allclose(weight, expected, rtol=1e-4)
        tolerance *= tightening


def test_an_image_without_texture_keeps_the_start():
    flat = np.full((90, 160), 90, np.uint8)
    start = np.array([[1.0, 0, 0.01], [0, 1, -0.02], [0, 0, 1]])
    _, found = aligned((flat, flat), start=start)
    np.testing.assert_allclose(found.cur_from_prev, start, atol=1e-12)


def test_the_start_is_not_changed(images):
    start = np.eye(3)
    aligned(images, start=start)
    np.testing.assert_array_equal(start, np.eye(3))
