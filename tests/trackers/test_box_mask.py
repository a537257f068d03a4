"""Masks of boxes, from a network that marks the pixels of a marker."""

import cv2
import numpy as np
import pytest

from helpers.stub_networks import Stub
from ssiam import FrameView
from ssiam.geometry import iou, map_box, xywh_from_corners
from ssiam.networks.box_mask import BOX_MASK_CONTEXT, BOX_MASK_CROP
from ssiam.trackers.box_mask import CONTEXT, CROP_SIDE, BoxMask, enlarged

SIZE_WH = 320, 240
FILL = np.zeros(3)


def test_crops_are_those_of_the_network():
    assert (CROP_SIDE, CONTEXT) == (BOX_MASK_CROP, BOX_MASK_CONTEXT)


def bright_cells():
    """A network with the logit of the share of each cell's pixels that are bright."""

    def answer(t, crop):
        share = cv2.resize(crop[0, 0], (64, 64), interpolation=cv2.INTER_AREA) / 255
        share = np.clip(share, 1e-4, 1 - 1e-4)
        return [np.log(share / (1 - share))[None, None].astype(np.float32)]

    return Stub(answer)


def frame_of(xywh):
    """A bright rectangle of whole pixels on black."""
    x, y, w, h = xywh
    frame = np.zeros((SIZE_WH[1], SIZE_WH[0], 3), np.uint8)
    frame[max(y, 0) : y + h, max(x, 0) : x + w] = 255
    return frame


@pytest.mark.parametrize(
    "xywh",
    [
        pytest.param((100, 80, 60, 40), id="wide"),
        pytest.param((100, 80, 12, 90), id="narrow"),
        pytest.param((40, 30, 200, 150), id="large"),
        pytest.param((-20, 80, 60, 40), id="left of the frame"),
        pytest.param((290, 215, 60, 60), id="beyond the corner"),
    ],
)
def test_the_mask_covers_the_object(xywh):
    frame = frame_of(xywh)
    x, y, w, h = xywh
    tracked = (x + 0.3, y - 0.4, w + 0.5, h + 0.2)
    outline = BoxMask(bright_cells(), 0.5).outline(FrameView(frame), tracked, FILL).read()
    truth = frame[..., 0] > 0
    assert outline.mask.shape == truth.shape
    assert (outline.mask & truth).sum() / (outline.mask | truth).sum() > 0.93


def test_the_mask_is_in_pixels_of_the_view():
    frame = frame_of((100, 80, 60, 40))
    turn = np.vstack([cv2.getRotationMatrix2D((160, 120), 4.0, 1.0), [0, 0, 1]])
    view = FrameView(frame, turn, border=20)
    tracked = map_box(turn, (100.0, 80.0, 60.0, 40.0))
    outline = BoxMask(bright_cells(), 0.5).outline(view, tracked, FILL).read()
    truth = cv2.warpAffine(frame, turn[:2], SIZE_WH)[..., 0] > 127
    assert (outline.mask & truth).sum() / (outline.mask | truth).sum() > 0.93
    assert iou(xywh_from_corners(outline.corners), tracked) > 0.75
    angle = np.degrees(np.arctan2(*np.diff(outline.corners[:2], axis=0)[0][::-1])) % 90
    assert min(angle, 90 - angle) == pytest.approx(4, abs=1.5)


def test_the_threshold_is_a_probability():
    frame = np.full((SIZE_WH[1], SIZE_WH[0], 3), 100, np.uint8)  # probability 0.39
    view, xywh = FrameView(frame), (100.0, 80.0, 60.0, 40.0)
    network = bright_cells()
    assert BoxMask(network, 0.35).outline(view, xywh, FILL).read().mask[100, 130]
    assert not BoxMask(network, 0.45).outline(view, xywh, FILL).read().mask.any()


def test_the_network_runs_when_the_outline_is_read():
    network = bright_cells()
    outline = BoxMask(network, 0.5).outline(
        FrameView(frame_of((100, 80, 60, 40))), (100, 80, 60, 40), FILL
    )
    assert not network.calls
    outline.read()
    outline.read()
    assert len(network.calls) == 1


def test_without_a_mask_the_corners_are_those_of_the_box():
    frame = np.zeros((SIZE_WH[1], SIZE_WH[0], 3), np.uint8)
    outline = BoxMask(bright_cells(), 0.5).outline(FrameView(frame), (10, 20, 30, 40), FILL).read()
    assert not outline.mask.any()
    assert xywh_from_corners(outline.corners) == pytest.approx((10, 20, 30, 40))


def test_the_crop_is_enlarged_about_the_box():
    assert enlarged((100.0, 80.0, 60.0, 40.0)) == pytest.approx((82, 68, 96, 64))


def recorded(view, xywh, fill=FILL, logit=8.0):
    network = Stub(lambda t, crop: [np.full((1, 1, 64, 64), logit, np.float32)])
    outline = BoxMask(network, 0.5).outline(view, xywh, fill).read()
    ((crop,),) = network.calls
    return outline, crop


def test_the_network_gets_the_crop_with_the_fill():
    frame = np.random.default_rng(1).integers(0, 256, (240, 320, 3)).astype(np.uint8)
    fill = np.array([10.0, 20, 30])
    _, crop = recorded(FrameView(frame), (-10.0, 80.0, 60.0, 40.0), fill)
    expected = FrameView(frame).crop((-28.0, 68.0, 96.0, 64.0), (128, 128), fill).image
    np.testing.assert_array_equal(crop[0], expected.transpose(2, 0, 1))
    assert crop.dtype == np.float32


@pytest.mark.parametrize(("border", "left"), [(0, 0), (20, -8)])
def test_a_mask_extends_to_the_border_of_a_stabilized_view(border, left):
    """The crop is 82 to 178 and 68 to 132, moved to the left by 90 px."""
    frame = np.zeros((240, 320, 3), np.uint8)
    shift = np.array([[1.0, 0, -3], [0, 1, 0], [0, 0, 1]])
    outline, _ = recorded(FrameView(frame, shift, border), (10.0, 80.0, 60.0, 40.0))
    rows, columns = np.nonzero(outline.mask)
    assert (columns.min(), columns.max()) == (max(left, 0), 87)
    assert (rows.min(), rows.max()) == (68, 131)
    raw, _ = recorded(FrameView(frame, border=20), (10.0, 80.0, 60.0, 40.0))
    np.testing.assert_array_equal(raw.mask, outline.mask)


def test_cells_of_the_mask_are_two_pixels_of_the_crop():
    logits = np.full((1, 1, 64, 64), -8, np.float32)
    logits[0, 0, 16:48, 8:40] = 8
    network = Stub(lambda t, crop: [logits])
    xywh = (90.0, 70.0, 80.0, 60.0)  # the crop is 128 by 96 px from (66, 52)
    frame = np.zeros((240, 320, 3), np.uint8)
    mask = BoxMask(network, 0.5).outline(FrameView(frame), xywh, FILL).read().mask
    rows, columns = np.nonzero(mask)
    assert (columns.min(), columns.max()) == (66 + 16, 66 + 80 - 1)
    assert (rows.min(), rows.max()) == pytest.approx((52 + 24, 52 + 72 - 1), abs=1)


@pytest.mark.parametrize(("threshold", "inside"), [(0.2, True), (0.3, False)])
def test_a_threshold_is_that_of_the_sigmoid(threshold, inside):
    logits = np.full((1, 1, 64, 64), np.log(0.25 / 0.75), np.float32)
    network = Stub(lambda t, crop: [logits])
    outline = BoxMask(network, threshold).outline(
        FrameView(np.zeros((240, 320, 3), np.uint8)), (100.0, 80.0, 60.0, 40.0), FILL
    )
    assert outline.read().mask.any() == inside


def test_bounds_are_those_of_the_object_in_a_box_that_is_not_exactly_its_own():
    """A faint border counts by the low thresholds, and a spot in the corner by none."""
    frame = frame_of((100, 80, 60, 40))
    frame[80:120, 160:164] = 50
    frame[64:68, 90:94] = 255
    bounds = BoxMask(bright_cells(), 0.5).bounds(FrameView(frame, border=0), (106, 76, 56, 46))
    assert bounds[-1] == pytest.approx((100, 80, 60, 40), abs=2)
    assert bounds[0] == pytest.approx((100, 80, 64, 40), abs=2)
    assert bounds[0, 2] > bounds[-1, 2] + 2


def test_an_empty_mask_has_no_bounds():
    frame = np.zeros((SIZE_WH[1], SIZE_WH[0], 3), np.uint8)
    bounds = BoxMask(bright_cells(), 0.5).bounds(FrameView(frame, border=0), (100, 80, 60, 40))
    assert np.isnan(bounds).all()
