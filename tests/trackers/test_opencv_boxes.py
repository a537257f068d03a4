"""Boxes that OpenCV's trackers cannot track are refused with one line, without side effects."""

import numpy as np
import pytest

import ssiam
from helpers.synthetic import generator
from ssiam.errors import ArgumentError, SsiamError, TrackingError
from ssiam.trackers import opencv

SIZE = (640, 360)
ODD_BOXES = {
    "along the upper border": (5, 5, 500, 10),
    "along the left border": (300, 5, 4, 350),
    "of one pixel": (300, 150, 1, 1),
    "a line across": (0, 150, 640, 1),
    "with one pixel in the frame": (639, 359, 50, 50),
    "touching the frame's corner": (-49, -49, 50, 50),
    "of four by four": (300, 150, 4, 4),
    "the whole frame": (0, 0, 640, 360),
}


@pytest.fixture(scope="module")
def frame():
    return generator(0).integers(0, 255, (SIZE[1], SIZE[0], 3), dtype=np.uint8)


@pytest.mark.parametrize("box", ODD_BOXES.values(), ids=ODD_BOXES)
@pytest.mark.parametrize("stabilize", ["predict", "off"])
@pytest.mark.parametrize("name", ["csrt", "kcf", "mil"])
def test_a_box_is_tracked_or_refused_in_one_line(frame, name, stabilize, box):
    tracker = ssiam.load_tracker(name, stabilize=stabilize)
    message = ""
    try:
        tracker.init(frame, box)
        tracker.update(frame)
    except SsiamError as error:
        message = str(error)
    assert "\n" not in message
    assert not message or name in message


@pytest.mark.parametrize("side", [1, 2, 3, 4])
def test_mil_refuses_boxes_on_which_it_would_hang(frame, side):
    with pytest.raises(ArgumentError, match=f"{side}x{side} pixels"):
        ssiam.load_tracker("mil", stabilize="off").init(frame, (300, 150, side, side))
    with pytest.raises(ArgumentError, match="1x80 pixels"):
        ssiam.load_tracker("mil", stabilize="off").init(frame, (300, 150, 1, 80))


@pytest.mark.parametrize("name", ["lite", "csrt", "kcf", "mil"])
def test_a_box_that_would_need_terabytes_is_refused(frame, name):
    tracker = ssiam.load_tracker(name, stabilize="off")
    for box in ((0, 0, 1e6, 1e6), (-5e5, 10, 1e6, 20), (10, 10, 20, 2e4)):
        with pytest.raises(ArgumentError, match="more than 2 times the frame of 640x360"):
            tracker.init(frame, box)


def test_a_refused_box_keeps_the_former_target(frame):
    tracker = opencv.OpenCvTracker("csrt")
    view = ssiam.stabilize.FrameView(frame)
    tracker.init(view, (300, 150, 60, 50))
    before = tracker.update(view)
    with pytest.raises(ArgumentError):
        tracker.init(view, (300, 150, 1, 1))
    after = tracker.update(view)
    assert after.box == pytest.approx(before.box, abs=2)
    assert after.score == pytest.approx(before.score, abs=0.1)


def test_opencvs_errors_on_a_frame_are_one_line(frame):
    tracker = ssiam.load_tracker("csrt", stabilize="off")
    tracker.init(frame, (300, 150, 60, 50))
    inner = tracker._tracker
    with pytest.raises(TrackingError, match="csrt failed on this frame") as caught:
        inner.update(ssiam.stabilize.FrameView(np.zeros((0, 0, 3), np.uint8)))
    assert "\n" not in str(caught.value)
