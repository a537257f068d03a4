"""The loop of `lite` on a marker, and its masks."""

import cv2
import numpy as np
import pytest

from helpers.stub_networks import Stub, marked
from helpers.tracker_loops import BOX, LoopTests, marker_frame, moving_marker
from ssiam import FrameView
from ssiam.geometry import rigid
from ssiam.trackers.lite import LiteNetworks, LiteTracker
from ssiam.trackers.lite_mask import pasted_mask


def marker_search():
    """Search network whose cells return the distances to the marker's edges."""

    def answer(t, crop, kernel):
        score = np.full((1, 1, 32, 32), -8, np.float32)
        quality = np.full((1, 1, 32, 32), 8, np.float32)
        distances = np.full((1, 4, 32, 32), 8, np.float32)
        on_marker = marked(crop[0])
        rows, columns = np.nonzero(on_marker)
        if len(rows):
            offsets = (np.arange(32) - 15.5) * 8
            y, x = np.meshgrid(offsets, offsets, indexing="ij")
            left, right = columns.min() - 127.5, columns.max() - 126.5
            top, bottom = rows.min() - 127.5, rows.max() - 126.5
            distances[0] = x - left, y - top, right - x, bottom - y
            distance = np.hypot(x - (left + right) / 2, y - (top + bottom) / 2)
            score[0, 0][distance < 12] = 8
        fine = np.zeros((256, 256), np.float32)
        fine[:255, :255] = on_marker
        stride4 = fine.reshape(64, 4, 64, 4).mean(axis=(1, 3))[None, None]
        return [score, quality, distances, (stride4 - 0.5) * 16]

    return Stub(answer)


def networks():
    return LiteNetworks(Stub(lambda t, crop: [crop]), marker_search())


class TestLite(LoopTests):
    def tracker(self):
        return LiteTracker(networks())

    @pytest.mark.parametrize("stab_from_raw", [np.eye(3), rigid(9, -6, 0.0), rigid(0, 0, 0.2)])
    def test_mask_and_corners_match_the_marker(self, stab_from_raw):
        frames, _ = moving_marker(BOX)
        tracker = self.tracker()
        tracker.init(FrameView(frames[0]), BOX)
        view = FrameView(frames[1], stab_from_raw, border=20)
        track = tracker.track(view)
        stabilized = cv2.warpPerspective(frames[1], stab_from_raw, view.size_wh)
        truth = marked(stabilized.transpose(2, 0, 1).astype(np.float32))
        assert (track.mask & truth).sum() / (track.mask | truth).sum() > 0.9
        rows, columns = np.nonzero(truth)
        center = columns.mean(), rows.mean()
        assert track.corners.mean(axis=0) == pytest.approx(center, abs=1.0)

    def test_an_empty_mask_gives_the_upright_box(self):
        tracker, _ = self.started()
        track = tracker.track(FrameView(np.full_like(marker_frame(BOX), 90)))
        assert not track.mask.any()
        x, y, w, h = track.box
        assert track.corners[[0, 2]] == pytest.approx(np.array([[x, y], [x + w, y + h]]))


class TestLiteWithoutMask(LoopTests):
    def tracker(self):
        return LiteTracker(networks(), masks=False)

    def test_tracks_have_neither_mask_nor_corners(self):
        frames, _ = moving_marker(BOX)
        tracker = self.tracker().clone()
        tracker.init(FrameView(frames[0]), BOX)
        track = tracker.track(FrameView(frames[1]))
        assert (track.mask, track.corners) == (None, None)


NOISE = np.random.default_rng(0).normal(0, 4, (1, 1, 64, 64)).astype(np.float32)
EVERYWHERE = (-5000.0, -5000.0, 10000.0, 10000.0)


def test_a_mask_is_pasted_at_its_crop():
    """A cell covers 4 by 4 pixels in a crop that is not resized."""
    logits = np.full((1, 1, 64, 64), -20, np.float32)
    logits[0, 0, 30, 40] = 20
    mask = pasted_mask(logits, (200.0, 180.0), 255, EVERYWHERE, (400, 300)).full((400, 300))
    rows, columns = np.nonzero(mask)
    left, top = 72, 52  # of the crop: whole pixels, rounded from center - 255 / 2
    assert (rows.mean() - top, columns.mean() - left) == pytest.approx((121.5, 161.5), abs=0.5)
    assert mask.sum() == pytest.approx(16, abs=8)


@pytest.mark.parametrize(
    "center_xy", [(40.0, 30.0), (-300.0, 100.0), (700.0, 390.0), (200.0, 900.0)]
)
@pytest.mark.parametrize("margin", [0, 50])
def test_a_mask_is_cut_at_the_edges_of_the_frame(center_xy, margin):
    """Crops cross the edge of the frame or are outside; the pixels are those of a larger frame."""
    offset = 1000
    shifted_xy = center_xy[0] + offset, center_xy[1] + offset
    larger = pasted_mask(NOISE, shifted_xy, 400, EVERYWHERE, (3000, 3000))
    whole = larger.full((3000, 3000))[offset : offset + 300, offset : offset + 400]
    mask = pasted_mask(NOISE, center_xy, 400, EVERYWHERE, (400, 300), margin)
    assert (mask.full((400, 300)) == whole).all()


def test_a_mask_is_cut_around_the_box():
    center_xy, size_wh = (200.0, 150.0), (400, 300)
    whole = pasted_mask(NOISE, center_xy, 300, EVERYWHERE, size_wh).full(size_wh)
    mask = pasted_mask(NOISE, center_xy, 300, (150.0, 100.0, 100.0, 50.0), size_wh).full(size_wh)
    near = np.zeros_like(whole)
    near[95:156, 140:261] = True
    assert (mask == whole & near).all()
    assert mask.sum() < whole.sum()
