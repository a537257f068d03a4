"""SiamMask's refinement windows and pasted masks, against the reference."""

import numpy as np
import pytest

from helpers.synthetic import generator
from helpers.tracker_loops import of_this_opencv
from ssiam.trackers.siammask import mask_probability, mask_square, paste_mask, refinement_windows

SIZE = (320, 240)


@pytest.fixture
def functions(golden):
    return golden("loops/functions.npz")


@pytest.mark.parametrize("number", [0, 1, 2])
def test_pasting_is_the_reference(functions, golden, number):
    x, y, side, _, column, row = functions[f"paste_{number}_in"]
    mask = (np.arange(127 * 127, dtype=np.float32) / (127 * 127)).reshape(127, 127)
    center = (x + side / 2, y + side / 2)
    square = mask_square(center, int(side), (int(row), int(column)), 255, 8)
    zoom = 127 / square[2]
    back_box = (-square[0] * zoom, -square[1] * zoom, SIZE[0] * zoom, SIZE[1] * zoom)
    assert back_box == pytest.approx(functions[f"paste_{number}_backbox"])
    expected = golden(of_this_opencv("loops/functions"))[f"paste_{number}"]
    np.testing.assert_allclose(paste_mask(mask, square, SIZE)[::3, ::3], expected, atol=1e-6)


def test_a_margin_extends_the_pasted_mask():
    mask = generator(1).random((127, 127), dtype=np.float32)
    square = (-30.0, -20.0, 90.0, 90.0)
    wide = paste_mask(mask, square, SIZE, margin=20)
    assert wide.shape == (280, 360)
    np.testing.assert_allclose(wide[20:-20, 20:-20], paste_mask(mask, square, SIZE), atol=1e-5)
    assert wide[:20].max() > 0


def test_mask_probability_of_any_logit():
    logits = np.linspace(-2000, 2000, 127 * 127, dtype=np.float32)[None]
    found = mask_probability(logits)
    assert found.dtype == np.float32
    expected = 1 / (1 + np.exp(-np.clip(logits.astype(float), -700, 700)))
    np.testing.assert_allclose(found.ravel(), expected[0], atol=1e-7)


@pytest.mark.parametrize("cell", [(0, 0), (12, 12), (24, 24), (5, 17), (24, 0), (3, 21)])
def test_windows_are_cut_from_padded_features(cell):
    random = generator(3)
    shapes = ((1, 256, 25, 25), (1, 64, 125, 125), (1, 256, 63, 63), (1, 512, 31, 31))
    corr, x0, p1, p2 = (random.random(shape, dtype=np.float32) for shape in shapes)
    windows = refinement_windows(corr, [x0, p1, p2], cell)
    layout = ((x0, 16, 4, 61), (p1, 8, 2, 31), (p2, 4, 1, 15), (corr, 0, 1, 1))
    for window, (features, pad, stride, side) in zip(windows, layout, strict=True):
        padded = np.pad(features, ((0, 0), (0, 0), (pad, pad), (pad, pad)))
        rows, columns = (slice(stride * index, stride * index + side) for index in cell)
        np.testing.assert_array_equal(window, padded[:, :, rows, columns])
        assert window.dtype == np.float32
        assert window.flags.c_contiguous
