"""The steps around OpenCV's trackers, with a given tracker and a given appearance."""

import numpy as np
import pytest

from helpers.synthetic import world
from ssiam import FrameView
from ssiam.errors import ArgumentError, MissingExtraError
from ssiam.geometry import rigid
from ssiam.trackers import opencv
from ssiam.trackers.opencv import OpenCvTracker, _is_inside, _new_tracker, pixel_box

FRAME = world(1, (320, 240))
BOX = (100.0, 80.0, 40.0, 30.0)


class Given:
    """OpenCV's interface; returns the given result, and records images and boxes."""

    def __init__(self):
        self.result, self.images, self.boxes = (True, (0, 0, 1, 1)), [], []

    def init(self, image, box):
        self.images.append(image)
        self.boxes.append(box)

    def update(self, image):
        self.images.append(image)
        return self.result


class GivenAppearance:
    def __init__(self, *similarities, found=None):
        self.similarities, self.found, self.updates = list(similarities), found, []
        self.searched = []

    def similarity(self, view, xywh):
        return self.similarities.pop(0)

    def update(self, view, xywh):
        self.updates.append(xywh)

    def find(self, view, xywh, reach):
        self.searched.append((xywh, reach))
        return self.found


@pytest.fixture
def made(monkeypatch):
    """Trackers that were made."""
    found = []

    def make(name):
        found.append(Given())
        return found[-1]

    monkeypatch.setattr(opencv, "_new_tracker", make)
    return found


def started(name, made, view=None):
    tracker = OpenCvTracker(name)
    tracker.init(view or FrameView(FRAME, border=20), BOX)
    return tracker, made[-1]


@pytest.mark.parametrize(
    ("xywh", "box"),
    [
        ((10.4, 20.6, 30.4, 40.6), (10, 21, 30, 41)),
        ((10.5, 11.5, 30.5, 31.5), (10, 12, 30, 32)),
        ((-5, -6, 30, 40), (0, 0, 25, 34)),
        ((300, 220, 30, 40), (300, 220, 20, 20)),
        ((-50, -60, 30, 40), (0, 0, 1, 1)),
        ((400, 300, 30, 40), (319, 239, 1, 1)),
        ((319.6, 239.7, 3, 4), (319, 239, 1, 1)),
        ((-10, -10, 400, 300), (0, 0, 320, 240)),
        ((5, 6, 0.2, 0.3), (5, 6, 1, 1)),
    ],
)
def test_boxes_of_whole_pixels_in_the_image(xywh, box):
    assert pixel_box(xywh, (320, 240)) == box


def test_a_tracker_starts_on_the_rendered_view(made):
    _, given = started("kcf", made)
    assert given.boxes == [(120, 100, 40, 30)]
    assert given.images[0].shape == (280, 360, 3)
    view = FrameView(FRAME, rigid(5, 3, 0.1), border=7)
    _, given = started("kcf", made, view)
    assert given.boxes == [(107, 87, 40, 30)]
    np.testing.assert_array_equal(given.images[0], view.render())


@pytest.mark.parametrize(("name", "margin"), [("csrt", 8 * 40 + 40), ("kcf", 160), ("mil", 160)])
def test_only_the_surroundings_of_the_last_box_are_rendered(made, name, margin):
    tracker, given = started(name, made)
    area = 100 - margin, 80 - margin, 40 + 2 * margin, 30 + 2 * margin
    assert tracker._rendered_area == area
    view = FrameView(FRAME, rigid(0, 0, 0.05), border=20)
    tracker.update(view)
    np.testing.assert_array_equal(given.images[1], view.render(area))


@pytest.mark.parametrize("result", [(False, (130, 90, 40, 30)), (True, (130, 90, 0, 30))])
def test_a_tracker_that_finds_nothing_keeps_the_last_box(made, result):
    tracker, given = started("csrt", made)
    given.result = result
    track = tracker.update(FrameView(FRAME, border=20))
    assert (track.box, track.score, track.evidence) == (BOX, 0, ())
    given.result = (True, (130, 90, 40, 0))
    assert tracker.update(FrameView(FRAME, border=20)).box == BOX
    given.result = (True, (130, 90, 1, 1))
    assert tracker.update(FrameView(FRAME, border=20)).box == (110, 70, 1, 1)


def logistic(name, first, recent):
    weights, bias = {
        "csrt": ((7.2, 3.9), -6.2),
        "kcf": ((6.3, 1.4), -4.9),
        "mil": ((7.2, 3.9), -6.2),
    }[name]
    return 1 / (1 + np.exp(-(weights[0] * first + weights[1] * recent + bias)))


@pytest.mark.parametrize("name", ["csrt", "kcf", "mil"])
def test_the_score_is_that_of_the_appearance(made, name):
    tracker, given = started(name, made)
    given.result = (True, (130, 90, 44, 33))
    tracker._appearance = GivenAppearance((0.7, 0.4))
    track = tracker.update(FrameView(FRAME, border=20))
    assert track.box == (110.0, 70.0, 44.0, 33.0)
    assert all(type(value) is float for value in track.box)
    assert track.evidence == (0.7, 0.4)
    assert track.score == pytest.approx(logistic(name, 0.7, 0.4))
    assert tracker._xywh == track.box


def evidence_of(score):
    """A similarity to the first appearance with this score of KCF."""
    return (np.log(score / (1 - score)) + 4.9) / 6.3, 0.0


@pytest.mark.parametrize(("score", "updated"), [(0.601, True), (0.599, False)])
def test_confident_boxes_become_the_recent_appearance(made, score, updated):
    tracker, given = started("kcf", made)
    given.result = (True, (130, 90, 44, 33))
    tracker._appearance = GivenAppearance(evidence_of(score))
    tracker.update(FrameView(FRAME, border=20))
    assert tracker._appearance.updates == ([(110, 70, 44, 33)] if updated else [])


@pytest.mark.parametrize(("score", "restarted"), [(0.401, True), (0.399, False)])
def test_seek_restarts_on_a_box_that_is_similar_enough(made, score, restarted):
    tracker, _ = started("kcf", made)
    found = (120.0, 90.0, 40.0, 30.0)
    tracker._appearance = GivenAppearance(evidence_of(score), found=found)
    track = tracker.seek(FrameView(FRAME, border=20), (110.0, 85.0, 40.0, 30.0))
    assert track.box == found
    assert track.score == pytest.approx(score)
    assert tracker._appearance.searched == [((110.0, 85.0, 40.0, 30.0), 0.7)]
    assert len(made) == 1 + restarted
    assert tracker._xywh == (found if restarted else BOX)
    if restarted:
        assert made[-1].boxes == [(140, 110, 40, 30)]


def test_seek_does_not_restart_outside_of_the_view(made):
    tracker, _ = started("kcf", made)
    found = (-50.0, 90.0, 40.0, 30.0)
    tracker._appearance = GivenAppearance((0.9, 0.9), found=found)
    assert tracker.seek(FrameView(FRAME, border=20), BOX).box == found
    assert len(made) == 1


@pytest.mark.parametrize(
    ("x", "y", "inside"),
    [
        (-30, -28, True),  # a fourth of the box is 10 and 8 px, the border 20 px
        (-31, 0, False),
        (0, -29, False),
        (310, 236, True),  # three fourths are 30 and 24 px
        (311, 0, False),
        (0, 237, False),
    ],
)
def test_the_central_half_of_a_box_is_inside_of_the_view(x, y, inside):
    assert _is_inside((x, y, 40, 32), FrameView(FRAME, border=20)) is inside
    assert not _is_inside((x - 20 * np.sign(x), y, 40, 32), FrameView(FRAME)) or inside


def test_without_a_border_the_frame_is_the_limit():
    assert _is_inside((-10, -8, 40, 32), FrameView(FRAME))
    assert not _is_inside((-11, -8, 40, 32), FrameView(FRAME))
    assert _is_inside((290, 216, 40, 32), FrameView(FRAME))
    assert not _is_inside((290, 217, 40, 32), FrameView(FRAME))


def test_only_kcf_can_seek():
    assert [OpenCvTracker(name).can_seek for name in ("csrt", "kcf", "mil")] == [False, True, False]
    assert OpenCvTracker("kcf").reseek_below == 0.2
    assert OpenCvTracker("kcf").center_inset == 1
    cloned = OpenCvTracker("mil").clone()
    assert (cloned._name, cloned._tracker, cloned._appearance) == ("mil", None, None)


def test_nothing_is_tracked_before_a_start():
    for call in (OpenCvTracker("kcf").update, lambda view: OpenCvTracker("kcf").seek(view, BOX)):
        with pytest.raises(ArgumentError, match="no target yet"):
            call(FrameView(FRAME))


@pytest.mark.parametrize(("name", "kind"), [("csrt", "TrackerCSRT"), ("kcf", "TrackerKCF")])
def test_another_opencv_without_the_tracker_is_named(monkeypatch, name, kind):
    assert type(_new_tracker(name)).__name__ == kind
    monkeypatch.delattr(opencv.cv2, kind)
    with pytest.raises(MissingExtraError, match=f"has no {name}: another OpenCV package"):
        _new_tracker(name)


@pytest.mark.parametrize(
    ("size", "fits"),
    [
        ((5, 4), True),
        ((4, 4), False),
        ((19, 1), False),
        ((11, 2), True),
        ((9, 2), False),
        ((10, 3), True),
    ],
)
def test_boxes_in_which_a_feature_of_mil_fits(size, fits):
    """A feature has at least nine pixels, in two or four equal parts."""
    parts = ((1, 2), (2, 1), (1, 4), (4, 1), (2, 2))
    w, h = size
    largest = max(c * ((w - 1) // c) * r * ((h - 1) // r) for c, r in parts)
    assert (largest >= 9) == fits
    tracker = OpenCvTracker("mil")
    if fits:
        tracker.init(FrameView(FRAME), (100.0, 80.0, w, h))
    else:
        with pytest.raises(ArgumentError, match=f"mil cannot track a box of {w}x{h} pixels"):
            tracker.init(FrameView(FRAME), (100.0, 80.0, w, h))
