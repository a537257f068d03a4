"""SiamFC's loop, compared with the reference on fixed responses, and on a marker."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.stub_networks import Stub, fixed_responses, marker_responses
from helpers.synthetic import generator, golden_video
from helpers.tracker_loops import LoopTests, assert_crops, recorded_crop_sides, sha256
from ssiam import FrameView
from ssiam.geometry import frame_center, rigid
from ssiam.trackers import siamfc
from ssiam.trackers.reference_crops import siamfc_crop
from ssiam.trackers.siamfc import SiamFc, SiamFcNetworks, _geometry, _upsampled


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
        x, y, w, h = tracker.update(FrameView(frame)).box
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
    sizes = [tracker.update(view).box[2:] for _ in range(20)]
    assert (low <= np.array(sizes[-1])).all()
    assert (np.array(sizes[-1]) <= high).all()


def test_the_score_is_the_sigmoid_of_the_response():
    tracker = flat_tracker(np.ones((3, 1, 1, 1), np.float32))
    view = FrameView(np.zeros((120, 160, 3), np.uint8))
    tracker.init(view, (60, 50, 20, 10))
    assert tracker.update(view).score == pytest.approx(1 / (1 + np.exp(-0.1)), abs=1e-4)


class TestOnMarker(LoopTests):
    def tracker(self):
        return SiamFc(SiamFcNetworks(Stub(whole), marker_responses()))


def target_of(xywh=(60.0, 50.0, 20.0, 10.0)):
    tracker = flat_tracker(np.ones((3, 1, 1, 1), np.float32))
    view = FrameView(np.zeros((120, 160, 3), np.uint8))
    tracker.init(view, xywh)
    return tracker, tracker._target


def test_the_geometry_of_a_first_box():
    center, size, search_side = _geometry((60.0, 50.0, 20.0, 10.0))
    assert center.tolist() == [69.5, 54.5]
    assert size.tolist() == [20, 10]
    assert {center.dtype, size.dtype} == {np.dtype(np.float32)}
    side = np.sqrt((20 + 15) * (10 + 15))
    assert search_side == pytest.approx(side * 255 / 127)
    assert target_of()[1].xywh == (60, 50, 20, 10)


@pytest.mark.parametrize(("peak", "shift"), [((135.5, 135.5), (0, 0)), ((151.5, 127.5), (8, -4))])
def test_a_target_moves_by_the_peaks_distance_from_the_middle(peak, shift):
    """16 cells of the upsampled response are 8 px of the search crop."""
    _, target = target_of()
    target.search_side = 255.0
    siamfc._move(target, np.array(peak), 1.0)
    assert target.center.tolist() == [69.5 + shift[0], 54.5 + shift[1]]
    _, target = target_of()
    target.search_side = 510.0
    siamfc._move(target, np.array(peak), 1.5)
    assert target.center.tolist() == [69.5 + 3 * shift[0], 54.5 + 3 * shift[1]]
    assert target.center.dtype == np.float32


@pytest.mark.parametrize(
    ("size", "factor", "kept"),
    [
        ((20.0, 10.0), 1.1, False),
        ((20.0, 10.0), 0.9, False),
        ((20.0, 2.0), 0.9, True),
        ((20.0, 2.2), 0.9, False),
        ((1.0, 1.0), 1.1, False),
        ((160.0, 10.0), 1.1, True),
        ((20.0, 120.0), 1.1, True),
        ((150.0, 100.0), 1.1, False),
        ((200.0, 10.0), 0.9, False),
    ],
)
def test_sizes_that_are_kept(size, factor, kept):
    tracker, target = target_of()
    target.size, side = np.array(size, np.float32), target.search_side
    tracker._resize(target, factor, (160, 120))
    scale = 1 if kept else 0.41 + 0.59 * factor
    assert target.size == pytest.approx(np.multiply(size, scale))
    assert target.search_side == pytest.approx(side * scale)
    assert target.size.dtype == np.float32


def test_cells_of_a_distractor_have_the_minimum():
    responses = generator(1).random((3, 17, 17)).astype(np.float32)
    none = _upsampled(responses, np.zeros(289, bool))
    assert (none.shape, none.dtype) == ((3, 272, 272), np.float32)
    expected = cv2.resize(responses[1], (272, 272), interpolation=cv2.INTER_CUBIC)
    np.testing.assert_array_equal(none[1], expected)
    flags = np.zeros(289, bool)
    flags[17 * 2 + 5] = True
    found = _upsampled(responses, flags)
    assert (found[:, 32:48, 80:96] == none.min()).all()
    found[:, 32:48, 80:96] = none[:, 32:48, 80:96]
    np.testing.assert_array_equal(found, none)


def test_candidates_are_the_cells_of_the_middle_scale():
    tracker, target = target_of()
    target.search_side, target.center = 510.0, np.array([70.0, 50.0], np.float32)
    responses = generator(1).random((3, 17, 17)).astype(np.float32)
    found = tracker._candidates(responses, target)
    np.testing.assert_allclose(found.score, 1 / (1 + np.exp(-responses[1].ravel())), rtol=1e-6)
    np.testing.assert_allclose(found.positions_xy[17 * 8 + 8], [70, 50], atol=1e-5)
    np.testing.assert_allclose(found.positions_xy[17 * 9 + 10], [70 + 32, 50 + 16], atol=1e-5)
    assert found.target_size == pytest.approx(np.sqrt(200))


def test_the_peak_is_that_of_response_and_window():
    tracker, _ = target_of()
    flat = np.full((272, 272), 0.5, np.float32)
    assert tracker._peak(flat) in {(row, column) for row in (135, 136) for column in (135, 136)}
    spike = flat.copy()
    spike[20, 30] = 9
    assert tracker._peak(spike) == (20, 30)
    tracker._parameters = replace(tracker._parameters, window_influence=1.0)
    assert tracker._peak(spike)[0] in (135, 136)
