"""Rotated boxes and pasted masks, against the references and on known shapes."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import generator
from helpers.tracker_loops import corner_distance, of_this_opencv
from ssiam.trackers.rotated_boxes import ellipse_box, rectangle_box
from ssiam.trackers.siammask import mask_probability, mask_square, paste_mask, refinement_windows

SIZE = (320, 240)
NAMES = [
    "ellipse30",
    "ellipse_axis",
    "rect20",
    "rect_axis",
    "circle",
    "limb",
    "L",
    "border",
    "corner",
    "two",
    "tiny",
    "thin",
    "empty",
]
SMALL = ("tiny", "empty")


@pytest.fixture
def functions(golden):
    return golden("loops/functions.npz")


def mask_of(functions, name):
    bits = np.unpackbits(functions[f"mask_bits_{name}"])[: SIZE[0] * SIZE[1]]
    return bits.reshape(SIZE[1], SIZE[0]).astype(bool)


def test_all_masks_of_the_golden_file_are_tested(functions):
    assert list(functions["mask_names"]) == NAMES


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("kind", "fit"),
    [("siammask_box", rectangle_box), ("siammask_e_box", lambda mask: ellipse_box(mask, 0.2583))],
    ids=["siammask", "siammask_e"],
)
def test_boxes_are_the_references(functions, golden, kind, fit, name):
    box = fit(mask_of(functions, name))
    if name in SMALL:
        assert box is None
    else:
        expected = golden(of_this_opencv("loops/functions"))[f"{kind}_{name}"]
        assert corner_distance(box, expected) < 1e-4


def rotated_ellipse(angle, center=(150, 110), axes=(120, 50)):
    canvas = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    return cv2.ellipse(canvas, (center, axes, angle), 1, -1).astype(bool)


@pytest.mark.parametrize("angle", [0, 30, 60, 90, 135])
@pytest.mark.parametrize("fit", [rectangle_box, ellipse_box])
def test_the_box_of_a_rotated_ellipse(fit, angle):
    box = fit(rotated_ellipse(angle))
    sides = np.sort(np.linalg.norm(np.diff(box[:3], axis=0), axis=1))
    np.testing.assert_allclose(box.mean(axis=0), (150, 110), atol=1.0)
    np.testing.assert_allclose(sides, (50, 120), atol=4.0)
    long_side = max(np.diff(box[:3], axis=0), key=np.linalg.norm)
    along = abs(long_side @ (np.cos(np.radians(angle)), np.sin(np.radians(angle))))
    assert along == pytest.approx(np.linalg.norm(long_side), rel=5e-3)


def test_the_refinement_only_shrinks_the_box():
    mask = rotated_ellipse(30) | rotated_ellipse(120, center=(190, 130), axes=(60, 10))
    areas = [cv2.contourArea(ellipse_box(mask, f).astype(np.float32)) for f in (None, 0.1, 0.4)]
    assert areas[0] >= areas[1] > areas[2]


@pytest.mark.parametrize("shape", ["line", "two lines", "frame", "half frame"])
@pytest.mark.parametrize("factor", [None, 0.2583, 5.0])
def test_odd_masks_give_finite_boxes_or_none(shape, factor):
    mask = np.zeros((SIZE[1], SIZE[0]), bool)
    match shape:
        case "line":
            mask[100, :] = True
        case "two lines":
            mask[100:102, :] = True
        case "frame":
            mask[:] = True
        case "half frame":
            mask[120:] = True
    box = ellipse_box(mask, factor)
    assert (box is None) == (shape == "line")
    assert box is None or np.isfinite(box).all()


def test_a_degenerate_ellipse_falls_back_to_the_rectangle(monkeypatch):
    mask = rotated_ellipse(30)
    expected = rectangle_box(mask)
    for ellipse in (((9999.0, 9999.0), (3.0, 4.0), 10.0), ((1.0, float("nan")), (3.0, 4.0), 10.0)):
        monkeypatch.setattr(cv2, "fitEllipse", lambda contour, ellipse=ellipse: ellipse)
        np.testing.assert_array_equal(ellipse_box(mask, 0.2583), expected)


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


@pytest.mark.parametrize("cell", [(0, 0), (12, 12), (24, 24), (5, 17), (24, 0)])
def test_windows_are_cut_from_padded_features(cell):
    r = generator(3)
    sides = (125, 63, 31)
    corr, *features = (r.random((1, 2, n, n), dtype=np.float32) for n in (25, *sides))
    *windows, kernel = refinement_windows(corr, features, cell)
    row, column = cell
    np.testing.assert_array_equal(kernel[:, :, 0, 0], corr[:, :, row, column])
    for each, window, (pad, step, side) in zip(
        features, windows, ((16, 4, 61), (8, 2, 31), (4, 1, 15)), strict=True
    ):
        padded = np.pad(each, ((0, 0), (0, 0), (pad, pad), (pad, pad)))
        expected = padded[:, :, row * step :, column * step :][:, :, :side, :side]
        np.testing.assert_array_equal(window, expected)
        assert window.flags.c_contiguous
