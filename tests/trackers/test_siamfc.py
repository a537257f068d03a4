"""SiamFC's loop, compared with the reference on fixed responses, and on a marker."""

import numpy as np
import pytest

from helpers.stub_networks import Stub, fixed_responses, marker_responses
from helpers.synthetic import golden_video
from helpers.tracker_loops import LoopTests, assert_crops, recorded_crop_sides, sha256
from ssiam import FrameView
from ssiam.geometry import frame_center, rigid
from ssiam.trackers.reference_crops import siamfc_crop
from ssiam.trackers.siamfc import SiamFc, SiamFcNetworks


def whole(t, crop):
    """A template network that returns the crop itself."""
    return [crop]


@pytest.mark.parametrize("video", ["A", "B"])
def test_loop_is_the_reference(golden, monkeypatch, video):
    z = golden(f"loops/siamfc_{video}.npz")
    frames, box = golden_video(video)
    template, search = Stub(whole), fixed_responses()
    tracker = SiamFc(SiamFcNetworks(template, search))
    sides = recorded_crop_sides(monkeypatch)
    tracker.init(FrameView(frames[0]), box)
    for t, frame in enumerate(frames[1:]):
        x, y, w, h = tracker.track(FrameView(frame)).box
        cy, cx = z["center_yx"][t]
        assert (x + (w - 1) / 2, y + (h - 1) / 2) == pytest.approx((cx, cy), abs=1e-6)
        assert (h, w) == pytest.approx(z["target_sz_hw"][t], abs=1e-6)
        assert (x + 1, y + 1, w, h) == pytest.approx(z["box_1based"][t], abs=1e-5)
        assert tracker._target.search_side == pytest.approx(z["x_sz"][t], abs=1e-6)
    assert sides == np.rint(z["crop_sizes"]).tolist()
    assert_crops(z, template, search)


def test_window_and_scales_are_the_reference(golden):
    z = golden("loops/siamfc_A.npz")
    tracker = SiamFc(SiamFcNetworks(Stub(whole), fixed_responses()))
    np.testing.assert_allclose(tracker._factors, z["scale_factors"], atol=1e-8)
    np.testing.assert_allclose(tracker._window[::16, ::16], z["hann_272_sum1_stride"])


def test_crops_are_the_reference(golden):
    z = golden("loops/functions.npz")
    frames, _ = golden_video("A", 1)
    fill = frames[0].mean(axis=(0, 1))[::-1]
    for number, (cy, cx, side, out) in enumerate(z["siamfc_cases_yx_size_out"]):
        center = np.array([cx, cy], np.float32)
        crop = siamfc_crop(FrameView(frames[0]), center, side, int(out), fill)
        assert sha256(crop) == z[f"siamfc_crop_{number}_sha256"]


def test_a_stabilized_crop_is_that_of_the_rendered_view():
    frames, _ = golden_video("A", 1)
    view = FrameView(frames[0], rigid(7, -4, 0.1, frame_center((320, 240))))
    center = np.array([160.0, 120.0], np.float32)
    fill = np.array([255.0, 128.0, 0.0])
    stabilized = siamfc_crop(view, center, 90.4, 127, fill).astype(int)
    rendered = siamfc_crop(FrameView(view.render()), center, 90.4, 127, fill)
    assert abs(stabilized - rendered).mean() < 4


def flat_tracker(responses):
    answer = Stub(lambda t, crops, kernel: [np.full((3, 1, 17, 17), 0.1, np.float32) * responses])
    return SiamFc(SiamFcNetworks(Stub(whole), answer))


@pytest.mark.parametrize(
    ("best_scale", "size_wh", "low", "high"),
    [
        pytest.param(0, (5, 2.5), (4, 2), (4.2, 2.1), id="shrinking"),
        pytest.param(2, (120, 60), (155, 77.5), (160, 80), id="growing"),
    ],
)
def test_sizes_stop_shrinking_and_growing(best_scale, size_wh, low, high):
    """The reference fails there on an empty crop, or on one that exhausts the memory."""
    responses = np.ones((3, 1, 1, 1), np.float32)
    responses[best_scale] = 2
    tracker = flat_tracker(responses)
    view = FrameView(np.zeros((120, 160, 3), np.uint8))
    tracker.init(view, (20, 30, *size_wh))
    sizes = [tracker.track(view).box[2:] for _ in range(20)]
    assert (low <= np.array(sizes[-1])).all()
    assert (np.array(sizes[-1]) <= high).all()


def test_the_score_is_the_sigmoid_of_the_response():
    tracker = flat_tracker(np.ones((3, 1, 1, 1), np.float32))
    view = FrameView(np.zeros((120, 160, 3), np.uint8))
    tracker.init(view, (60, 50, 20, 10))
    assert tracker.track(view).score == pytest.approx(1 / (1 + np.exp(-0.1)), abs=1e-4)


class TestOnMarker(LoopTests):
    def tracker(self):
        return SiamFc(SiamFcNetworks(Stub(whole), marker_responses()))
