"""Rotated boxes of masks, compared with the references and on known shapes."""

import cv2
import numpy as np
import pytest

from helpers.tracker_loops import corner_distance, of_this_opencv
from ssiam.trackers.rotated_boxes import ellipse_box, rectangle_box

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
