"""SiamRPN's loop, compared with the references on fixed maps, and on a marker."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.stub_networks import Stub, fixed_maps, kernels, marker_maps
from helpers.synthetic import golden_video
from helpers.tracker_loops import (
    LoopTests,
    assert_crops,
    recorded_crop_sides,
    recorded_indices,
    sha256,
)
from ssiam import FrameView
from ssiam.trackers import siammask
from ssiam.trackers.reference_crops import siammask_crop
from ssiam.trackers.siamrpn import PARAMETERS, SiamRpn, SiamRpnNetworks

# "fool-box": the loop of foolwood/SiamMask for upright boxes.
LOOPS = {
    "siamrpn_r50_l234_dwxcorr": PARAMETERS["siamrpn_r50_l234_dwxcorr"],
    "siamrpn_alex_dwxcorr": PARAMETERS["siamrpn_alex_dwxcorr"],
    "fool-box": siammask.PARAMETERS["siammask_vot"],
}


def stub_tracker(search, parameters=PARAMETERS["siamrpn_r50_l234_dwxcorr"]):
    return SiamRpn(SiamRpnNetworks(Stub(kernels), search), parameters)


@pytest.mark.parametrize("video", ["A", "B"])
@pytest.mark.parametrize("name", LOOPS)
def test_loop_is_the_reference(golden, monkeypatch, name, video):
    z = golden(f"loops/{name}_{video}.npz")
    frames, box = golden_video(video)
    parameters = LOOPS[name]
    template, search = Stub(kernels), fixed_maps(parameters.side)
    tracker = SiamRpn(SiamRpnNetworks(template, search), parameters)
    indices, sides = recorded_indices(monkeypatch), recorded_crop_sides(monkeypatch)
    tracker.init(FrameView(frames[0]), box)
    for t, frame in enumerate(frames[1:]):
        track = tracker.update(FrameView(frame))
        assert track.box == pytest.approx(z["bbox"][t], abs=1e-5)
        assert track.score == pytest.approx(z["score"][t], abs=1e-6)
        assert track.corners is None
    assert indices == z["best_idx"].tolist()
    assert sides == z["crop_sizes"].tolist()
    assert_crops(z, template, search)


def test_all_kernels_are_passed_to_the_search():
    search = fixed_maps(25)
    tracker = stub_tracker(search)
    frames, box = golden_video("A", 2)
    tracker.init(FrameView(frames[0]), box)
    tracker.update(FrameView(frames[1]))
    assert [each.shape[1] for each in search.calls[0]] == [3, 1, 2]


def test_crops_of_the_siammask_authors(golden):
    z = golden("loops/functions.npz")
    frames, _ = golden_video("A", 1)
    view, fill = FrameView(frames[0]), frames[0].mean(axis=(0, 1))
    for number, (cx, cy, out, side) in enumerate(z["subwindow_cases"]):
        crop = siammask_crop(view, (cx, cy), int(side), int(out), fill)
        assert sha256(crop.transpose(2, 0, 1)) == z[f"subwindow_foolwood_{number}_sha256"]


def test_each_variant_has_its_own_center_of_a_first_box():
    frames, box = golden_video("A", 1)
    pysot = stub_tracker(marker_maps())
    authors = stub_tracker(marker_maps(), replace(LOOPS["fool-box"], lr=0.0))
    for tracker, center in ((pysot, (83.5, 121.5)), (authors, (84.0, 122.0))):
        tracker.init(FrameView(frames[0]), box)
        assert tracker._target.state.center_xy == center


class TestOnMarker(LoopTests):
    def tracker(self):
        return stub_tracker(marker_maps())

    def test_without_a_marker_the_score_is_low(self):
        tracker, frames = self.started()
        assert tracker.update(FrameView(np.zeros_like(frames[1]))).score < 0.01
