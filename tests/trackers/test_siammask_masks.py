"""SiamMask's refinement windows and pasted masks, against the reference."""

import numpy as np
import pytest

from helpers.synthetic import generator
from helpers.tracker_loops import of_this_opencv
from ssiam.trackers.rotated_boxes import ellipse_box, rectangle_box
from ssiam.trackers.siamese import TargetState
from ssiam.trackers.siammask import (
    PARAMETERS,
    SiamMaskParameters,
    _frame_from_mask,
    _outline,
    _window,
    mask_probability,
    mask_square,
    paste_mask,
    refinement_windows,
)

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


@pytest.mark.parametrize(
    ("cell", "square"),
    [
        ((12, 12), (100 - 255 / 2 + 64, 80 - 255 / 2 + 64, 127, 127)),
        ((4, 4), (100 - 255 / 2, 80 - 255 / 2, 127, 127)),
        ((13, 10), (100 - 255 / 2 + 48, 80 - 255 / 2 + 72, 127, 127)),
    ],
)
def test_the_square_of_a_cell(cell, square):
    """Row 12 and column 12 are the middle, which is 64 px from the corner."""
    assert mask_square((100.0, 80.0), 255, cell, 255, 8) == pytest.approx(square)
    x, y, w, h = square
    large = mask_square((200.0, 160.0), 510, cell, 255, 8)
    assert large == pytest.approx((2 * x, 2 * y, 2 * w, 2 * h))
    shifted = mask_square((100.0, 80.0), 255, cell, 255, 6)
    assert shifted == pytest.approx((x + 8, y + 8, w, h))


def test_a_pasted_mask_is_smaller_by_a_pixel_of_the_frame():
    """Both axes have their own factor, (size - 1) / size."""
    assert _frame_from_mask((30.0, 20.0, 254.0, 254.0), (100, 50)) == pytest.approx(
        np.array([[2 * 0.99, 0, 30 * 0.99], [0, 2 * 0.98, 20 * 0.98]])
    )


BOX = TargetState((60.0, 50.0), (40.0, 30.0))


def logits_of(rows, columns):
    logits = np.full((127, 127), -20, np.float32)
    logits[slice(*rows), slice(*columns)] = 20
    return logits.reshape(1, -1)


def outline_of(logits, *, fit="rectangle", margin=0, threshold=0.3, factor=None, square=None):
    parameters = SiamMaskParameters(0.1, 0.4, 0.3, fit=fit, mask_threshold=threshold, factor=factor)
    square = square or (0.0, 0.0, 127.0, 127.0)
    return _outline(logits, square, BOX, (160, 120), margin, parameters)


@pytest.mark.parametrize("margin", [0, 15])
def test_an_outline_has_the_mask_of_the_frame_and_its_box(margin):
    found = outline_of(logits_of((30, 80), (20, 100)), margin=margin)
    assert found.mask.shape == (120, 160)
    rows, columns = np.nonzero(found.mask)
    assert (columns.min(), columns.max()) == pytest.approx((20, 99), abs=1)
    assert (rows.min(), rows.max()) == pytest.approx((30, 79), abs=1)
    low, high = found.corners.min(axis=0), found.corners.max(axis=0)
    assert low == pytest.approx((columns.min(), rows.min()))
    assert high == pytest.approx((columns.max(), rows.max()))


def test_a_margin_lets_the_box_reach_beyond_the_frame():
    logits = logits_of((30, 80), (20, 100))
    square = (-30.0, 0.0, 127.0, 127.0)
    for margin, left in ((0, 0), (5, -5), (20, -10)):
        found = outline_of(logits, margin=margin, square=square)
        assert found.corners[:, 0].min() == pytest.approx(left, abs=1)
        assert found.mask.shape == (120, 160)


@pytest.mark.parametrize(("threshold", "inside"), [(0.3, True), (0.32, False)])
def test_pixels_above_the_threshold_belong_to_the_mask(threshold, inside):
    logits = np.full((1, 127 * 127), np.log(0.31 / 0.69), np.float32)
    assert outline_of(logits, threshold=threshold).mask[60, 60] == inside


def test_without_a_mask_the_corners_are_those_of_the_box():
    for fit in ("rectangle", "ellipse"):
        found = outline_of(logits_of((0, 0), (0, 0)), fit=fit, margin=10)
        assert found.corners.tolist() == [[40, 35], [80, 35], [80, 65], [40, 65]]


def test_the_box_is_fitted_as_the_parameters_say():
    """An ellipse's box is within that of its mask; alpha moves the sides inwards."""
    logits = logits_of((50, 70), (20, 100)).reshape(127, 127)
    logits[40:50, 58:62] = 20  # a limb
    logits = logits.reshape(1, -1)
    heights = [
        np.ptp(outline_of(logits, fit=fit, factor=factor).corners[:, 1])
        for fit, factor in (("rectangle", None), ("ellipse", None), ("ellipse", 0.4))
    ]
    assert heights[0] > heights[1] >= heights[2]
    mask = outline_of(logits).mask
    for fit, factor, expected in (
        ("rectangle", None, rectangle_box(mask)),
        ("ellipse", None, ellipse_box(mask)),
        ("ellipse", 0.4, ellipse_box(mask, 0.4)),
    ):
        found = outline_of(logits, fit=fit, factor=factor).corners
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_the_defaults_of_the_parameters():
    parameters = SiamMaskParameters(0.1, 0.4, 0.3)
    assert (parameters.mask_threshold, parameters.fit, parameters.factor) == (
        0.3,
        "rectangle",
        None,
    )
    assert (parameters.instance, parameters.base, parameters.variant) == (255, 8, "pysot")
    assert {name: each.fit for name, each in PARAMETERS.items()} == {
        name: "ellipse" if name.startswith("siammask_e") else "rectangle" for name in PARAMETERS
    }


@pytest.mark.parametrize(
    ("top", "left"), [(-2, 3), (3, -2), (6, 1), (1, 7), (-3, -3), (2, 2), (8, 9)]
)
def test_windows_are_zero_outside_of_the_features(top, left):
    features = generator(4).random((1, 2, 10, 12), dtype=np.float32)
    found = _window(features, top, left, 4)
    padded = np.pad(features, ((0, 0), (0, 0), (5, 5), (5, 5)))
    np.testing.assert_array_equal(found, padded[:, :, top + 5 : top + 9, left + 5 : left + 9])
    assert found.dtype == np.float32
