"""Masks of boxes, from a network that marks the pixels of a marker."""

import cv2
import numpy as np
import pytest

from helpers.stub_networks import Stub
from ssiam import FrameView
from ssiam.geometry import iou, map_box, xywh_from_corners
from ssiam.networks.box_mask import BOX_MASK_CONTEXT, BOX_MASK_CROP
from ssiam.trackers.box_mask import CONTEXT, CROP_SIDE, BoxMask

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
