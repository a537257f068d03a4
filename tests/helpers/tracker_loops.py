"""Helpers for the tests of all tracking loops: golden crops, and properties on a marker."""

import hashlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.stub_networks import MARKER
from ssiam import FrameView
from ssiam.errors import ArgumentError
from ssiam.geometry import frame_center, map_box, rigid
from ssiam.trackers.distractors import DistractorTracker

GOLDEN = Path(__file__).parents[1] / "golden"
OPENCV = cv2.__version__.split(".")[0]
SIZE = (320, 240)
BOX = (120.0, 90.0, 40.0, 40.0)
TRANSFORMS = [
    pytest.param(rigid(9, -6, 0.0), id="shift"),
    pytest.param(rigid(0, 0, 0.2, frame_center(SIZE)), id="rotation"),
    pytest.param(rigid(-14.3, 7.9, -0.1, frame_center(SIZE)), id="both"),
]


def sha256(array):
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def of_this_opencv(name):
    """The golden file of the running OpenCV's major version, else that of version 5."""
    path = GOLDEN / f"{name}_cv4.npz"
    return f"{name}_cv4.npz" if OPENCV == "4" and path.exists() else f"{name}.npz"


def polygon_tolerance(z):
    """Tolerance of corners, pixels: OpenCV 4 and 5 interpolate masks differently."""
    return 1e-3 if str(z["opencv"]) == OPENCV else 3.0


def corner_distance(found, expected):
    """Largest difference of two boxes' corners, in any cyclic order."""
    expected = np.reshape(expected, (4, 2))
    return min(np.abs(np.roll(found, shift, axis=0) - expected).max() for shift in range(4))


def assert_crops(z, template, search):
    """The networks' first and last crops are the reference's."""
    if "z_crop_u8_sha256" not in z:
        return
    first, last = search.calls[0][0], search.calls[-1][0]
    middle_scale = len(first) // 2
    assert sha256(template.calls[0][0][0].astype(np.uint8)) == z["z_crop_u8_sha256"]
    for key, crops in (("t1", first), ("tlast", last)):
        strided = crops[middle_scale, :, ::2, ::2].astype(np.uint8)
        assert sha256(strided) == z[f"x_crop_{key}_u8_s2_sha256"]


def recorded_indices(monkeypatch):
    """A list to which the index of each candidate selected from now on is appended."""
    indices = []
    update = DistractorTracker.update

    def recording(distractors, candidates, best):
        indices.append(best)
        update(distractors, candidates, best)

    monkeypatch.setattr(DistractorTracker, "update", recording)
    return indices


def recorded_crop_sides(monkeypatch):
    """A list to which the side of each crop from now on is appended."""
    sides = []
    crop = FrameView.crop_square

    def recording(view, center_xy, side, out, fill):
        sides.append(side)
        return crop(view, center_xy, side, out, fill)

    monkeypatch.setattr(FrameView, "crop_square", recording)
    return sides


def marker_frame(box, angle=0.0):
    """A gray frame with an ellipse of the marker's color in the box; `angle` in degrees."""
    frame = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    x, y, w, h = box
    center, axes = (x + (w - 1) / 2, y + (h - 1) / 2), (w, h)
    cv2.ellipse(frame, (center, axes, angle), MARKER, -1)
    return frame


def moving_marker(box, count=6, step=(5.0, -4.0)):
    """Frames with a moving marker, and its boxes."""
    x, y, w, h = box
    boxes = [(x + t * step[0], y + t * step[1], w, h) for t in range(count)]
    return [marker_frame(each) for each in boxes], boxes


def center_distance(box, other):
    """Distance of two boxes' centers, pixels."""
    (x, y, w, h), (u, v, p, q) = box, other
    return np.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2)


class LoopTests:
    """Properties of every loop; a subclass makes the tracker."""

    def tracker(self):
        raise NotImplementedError

    def started(self, box=BOX):
        frames, _ = moving_marker(box)
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), box)
        return tracker, frames

    def test_the_marker_is_tracked(self):
        frames, boxes = moving_marker(BOX)
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), BOX)
        for frame, box in zip(frames[1:], boxes[1:], strict=True):
            track = tracker.update(FrameView(frame))
            assert center_distance(track.box, box) < 2.0
            assert track.box[2] == pytest.approx(40, abs=4)
            assert 0.8 < track.score <= 1

    @pytest.mark.parametrize("stab_from_raw", TRANSFORMS)
    def test_boxes_are_in_the_stabilized_views_pixels(self, stab_from_raw):
        frames, boxes = moving_marker(BOX)
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), BOX)
        for frame, box in zip(frames[1:], boxes[1:], strict=True):
            view = FrameView(frame, stab_from_raw, border=20)
            track = tracker.update(view)
            assert center_distance(track.box, map_box(stab_from_raw, box)) < 2.0
            assert center_distance(track.mapped(view.raw_from_stab, SIZE).box, box) < 2.0

    def test_seek_finds_a_target_far_from_the_last_box(self):
        tracker, _ = self.started()
        far, near = (250.0, 20.0, 40.0, 40.0), (243.0, 26.0, 40.0, 40.0)
        assert center_distance(tracker.update(FrameView(marker_frame(far))).box, far) > 20
        assert center_distance(tracker.seek(FrameView(marker_frame(far)), near).box, far) < 2.0
        assert center_distance(tracker.update(FrameView(marker_frame(far))).box, far) < 2.0

    @pytest.mark.parametrize("stab_from_raw", TRANSFORMS)
    def test_seek_takes_a_box_in_the_views_pixels(self, stab_from_raw):
        tracker, _ = self.started()
        far = (40.0, 160.0, 40.0, 40.0)
        stab_box = map_box(stab_from_raw, far)
        track = tracker.seek(FrameView(marker_frame(far), stab_from_raw, border=20), stab_box)
        assert center_distance(track.box, stab_box) < 2.0

    def test_the_best_candidate_is_that_of_update(self):
        tracker, frames = self.started()
        if not tracker.has_responses:
            pytest.skip("the tracker lists no candidates")
        plain, _ = self.started()
        for frame in frames[1:]:
            view = FrameView(frame, TRANSFORMS[2].values[0])
            first, response = tracker.respond(view), tracker.respond(view)
            np.testing.assert_array_equal(first.ranked, response.ranked, "respond changes nothing")
            track, expected = tracker.accept(view, response, response.best), plain.update(view)
            assert (track.box, track.score) == (expected.box, expected.score)
            assert response.objects == [response.best]
            best = response.xywh(response.best)
            assert center_distance(best, track.box) < 1.0  # FEAR's boxes are in whole pixels

    def test_another_candidate_can_be_taken(self):
        tracker, frames = self.started()
        if not tracker.has_responses:
            pytest.skip("the tracker lists no candidates")
        x, y = frames[1].shape[1] / 2, 70.0
        view = FrameView(frames[1])
        response = tracker.respond(view)
        other = int(np.hypot(response.boxes[0] - x, response.boxes[1] - y).argmin())
        track = tracker.accept(view, response, other)
        assert center_distance(track.box, response.xywh(other)) < 1.0
        far = (230.0, 40.0, 40.0, 40.0)
        tracker.move_to((226.0, 44.0, 40.0, 40.0))
        view = FrameView(marker_frame(far))
        response = tracker.respond(view)
        assert center_distance(response.xywh(response.best), far) < 2.0

    def test_a_clone_shares_no_state(self):
        frames, _ = moving_marker(BOX)
        alone, _ = self.started()
        expected = [alone.update(FrameView(frame)).box for frame in frames[1:]]
        first, _ = self.started()
        second = first.clone()
        second.init(FrameView(marker_frame((30, 150, 50, 50))), (30, 150, 50, 50))
        for frame, box in zip(frames[1:], expected, strict=True):
            second.update(FrameView(marker_frame((30, 150, 50, 50))))
            assert first.update(FrameView(frame)).box == box

    def test_a_clone_has_no_target(self):
        tracker, frames = self.started()
        view = FrameView(frames[1])
        with pytest.raises(ArgumentError, match="no target yet"):
            tracker.clone().update(view)
        with pytest.raises(ArgumentError, match="no target yet"):
            tracker.clone().seek(view, BOX)

    def test_frames_are_not_modified(self):
        frames, _ = moving_marker(BOX)
        for frame in frames:
            frame.flags.writeable = False
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), BOX)
        for frame in frames[1:]:
            tracker.update(FrameView(frame))
            tracker.update(FrameView(frame, rigid(4, 3, 0.05)))

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
        tracker.init(FrameView(marker_frame(box)), box)
        for stab_from_raw in (np.eye(3), rigid(30, 20, 0.1)):
            for _ in range(4):
                track = tracker.update(FrameView(marker_frame(box), stab_from_raw))
                assert np.isfinite(track.box).all()
                assert min(track.box[2:]) > 0
                assert 0 <= track.score <= 1

    def test_results_repeat(self):
        frames, _ = moving_marker(BOX)
        runs = []
        for _ in range(2):
            tracker, _ = self.started()
            runs.append([tracker.update(FrameView(frame)).box for frame in frames[1:]])
        assert runs[0] == runs[1]
