"""What the tests of all tracking loops share: golden crops, and properties on a marker."""

import hashlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.stub_networks import MARKER
from ssiam import FrameView
from ssiam.geometry import frame_centre, map_box, rigid
from ssiam.trackers import siamrpn

GOLDEN = Path(__file__).parents[1] / "golden"
OPENCV = cv2.__version__.split(".")[0]
SIZE = (320, 240)
BOX = (120.0, 90.0, 40.0, 40.0)
STEADYINGS = [
    pytest.param(rigid(9, -6, 0.0), id="shift"),
    pytest.param(rigid(0, 0, 0.2, frame_centre(SIZE)), id="turn"),
    pytest.param(rigid(-14.3, 7.9, -0.1, frame_centre(SIZE)), id="both"),
]


def sha256(array):
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def of_this_opencv(name):
    """The golden file of the running OpenCV's major version, else that of version 5."""
    path = GOLDEN / f"{name}_cv4.npz"
    return f"{name}_cv4.npz" if OPENCV == "4" and path.exists() else f"{name}.npz"


def polygon_tolerance(z):
    """Pixels by which corners may differ: OpenCV 4 and 5 interpolate masks differently."""
    return 1e-3 if str(z["opencv"]) == OPENCV else 3.0


def corner_distance(found, expected):
    """Largest difference of two boxes' corners, whichever they begin with."""
    expected = np.reshape(expected, (4, 2))
    return min(np.abs(np.roll(found, turn, axis=0) - expected).max() for turn in range(4))


def assert_crops(z, template, search):
    """The first and the last crops that the networks were given are the reference's."""
    if "z_crop_u8_sha256" not in z:
        return
    first, last = search.given[0][0], search.given[-1][0]
    middle = len(first) // 2
    assert sha256(template.given[0][0][0].astype(np.uint8)) == z["z_crop_u8_sha256"]
    for key, crops in (("t1", first), ("tlast", last)):
        strided = crops[middle, :, ::2, ::2].astype(np.uint8)
        assert sha256(strided) == z[f"x_crop_{key}_u8_s2_sha256"]


def recorded_indices(monkeypatch):
    """The indices that `choose` gives from now on, as they come."""
    indices = []
    choose = siamrpn.select_candidate

    def noted(*arguments):
        best, penalty = choose(*arguments)
        indices.append(best)
        return best, penalty

    monkeypatch.setattr(siamrpn, "select_candidate", noted)
    return indices


def crop_sides(monkeypatch):
    """The sides of all crops from now on, as they are cut."""
    sides = []
    crop = FrameView.crop

    def noted(view, center_xy, side, out, fill):
        sides.append(side)
        return crop(view, center_xy, side, out, fill)

    monkeypatch.setattr(FrameView, "crop", noted)
    return sides


def picture(box, turn=0.0):
    """A grey frame with a disc of the marker's colour in the box, cut off at the border."""
    frame = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    x, y, w, h = box
    centre, axes = (x + (w - 1) / 2, y + (h - 1) / 2), (w, h)
    cv2.ellipse(frame, (centre, axes, turn), MARKER, -1)
    return frame


def moving(box, count=6, step=(5.0, -4.0)):
    """Frames whose marker walks, and its boxes."""
    x, y, w, h = box
    boxes = [(x + t * step[0], y + t * step[1], w, h) for t in range(count)]
    return [picture(each) for each in boxes], boxes


def off_centre(box, other):
    """Distance of two boxes' centres, pixels."""
    (x, y, w, h), (u, v, p, q) = box, other
    return np.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2)


class LoopTests:
    """Properties of every loop; a subclass gives the tracker."""

    def tracker(self):
        raise NotImplementedError

    def started(self, box=BOX):
        frames, _ = moving(box)
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), box)
        return tracker, frames

    def test_the_marker_is_followed(self):
        frames, boxes = moving(BOX)
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), BOX)
        for frame, box in zip(frames[1:], boxes[1:], strict=True):
            track = tracker.track(FrameView(frame))
            assert off_centre(track.box, box) < 2.0
            assert track.box[2] == pytest.approx(40, abs=4)
            assert 0.8 < track.score <= 1

    @pytest.mark.parametrize("stab_from_raw", STEADYINGS)
    def test_a_steadied_view_gives_the_mapped_box(self, stab_from_raw):
        frames, boxes = moving(BOX)
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), BOX)
        for frame, box in zip(frames[1:], boxes[1:], strict=True):
            view = FrameView(frame, stab_from_raw, border=20)
            track = tracker.track(view)
            assert off_centre(track.box, map_box(stab_from_raw, box)) < 2.0
            assert off_centre(track.mapped(view.raw_from_stab, SIZE).box, box) < 2.0

    def test_a_target_far_away_is_found_where_it_is_sought(self):
        tracker, _ = self.started()
        far, near = (250.0, 20.0, 40.0, 40.0), (243.0, 26.0, 40.0, 40.0)
        assert off_centre(tracker.track(FrameView(picture(far))).box, far) > 20
        assert off_centre(tracker.seek(FrameView(picture(far)), near).box, far) < 2.0
        assert off_centre(tracker.track(FrameView(picture(far))).box, far) < 2.0

    @pytest.mark.parametrize("stab_from_raw", STEADYINGS)
    def test_seeking_goes_by_the_views_pixels(self, stab_from_raw):
        tracker, _ = self.started()
        far = (40.0, 160.0, 40.0, 40.0)
        sought = map_box(stab_from_raw, far)
        track = tracker.seek(FrameView(picture(far), stab_from_raw, border=20), sought)
        assert off_centre(track.box, sought) < 2.0

    def test_another_shares_no_state(self):
        frames, _ = moving(BOX)
        alone, _ = self.started()
        expected = [alone.track(FrameView(frame)).box for frame in frames[1:]]
        first, _ = self.started()
        second = first.clone()
        second.init(FrameView(picture((30, 150, 50, 50))), (30, 150, 50, 50))
        for frame, box in zip(frames[1:], expected, strict=True):
            second.track(FrameView(picture((30, 150, 50, 50))))
            assert first.track(FrameView(frame)).box == box

    def test_frames_are_not_modified(self):
        frames, _ = moving(BOX)
        for frame in frames:
            frame.flags.writeable = False
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), BOX)
        for frame in frames[1:]:
            tracker.track(FrameView(frame))
            tracker.track(FrameView(frame, rigid(4, 3, 0.05)))

    @pytest.mark.parametrize(
        "box",
        [
            pytest.param((-15.0, -12.0, 40.0, 40.0), id="corner"),
            pytest.param((298.0, 100.0, 40.0, 40.0), id="right"),
            pytest.param((-39.0, 239.0, 40.0, 40.0), id="one pixel inside"),
            pytest.param((400.0, 300.0, 40.0, 40.0), id="outside"),
            pytest.param((10.0, 10.0, 1.0, 1.0), id="one pixel"),
            pytest.param((-50.0, -40.0, 420.0, 320.0), id="larger than the frame"),
        ],
    )
    def test_boxes_at_the_border_and_beyond(self, box):
        tracker = self.tracker()
        tracker.init(FrameView(picture(box)), box)
        for stab_from_raw in (np.eye(3), rigid(30, 20, 0.1)):
            for _ in range(4):
                track = tracker.track(FrameView(picture(box), stab_from_raw))
                assert np.isfinite(track.box).all()
                assert min(track.box[2:]) > 0
                assert 0 <= track.score <= 1

    def test_results_repeat(self):
        frames, _ = moving(BOX)
        runs = []
        for _ in range(2):
            tracker, _ = self.started()
            runs.append([tracker.track(FrameView(frame)).box for frame in frames[1:]])
        assert runs[0] == runs[1]
