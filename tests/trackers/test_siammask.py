"""The loops of SiamMask and SiamMask_E, compared with the references, and on a marker."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.stub_networks import (
    Stub,
    fixed_features,
    fixed_refinement,
    kernels,
    marker_features,
    marker_refinement,
)
from helpers.synthetic import golden_video
from helpers.tracker_loops import (
    BOX,
    SIZE,
    TRANSFORMS,
    LoopTests,
    assert_crops,
    corner_distance,
    marker_frame,
    of_this_opencv,
    polygon_tolerance,
    recorded_crop_sides,
    recorded_indices,
)
from ssiam import FrameView
from ssiam.geometry import corners_from_xywh, map_points, rigid
from ssiam.trackers.siammask import PARAMETERS, SiamMask, SiamMaskNetworks

LOOPS = {
    "siammask_r50_l3": "siammask_r50_l3",
    "siammask_e": "siammask_e",
    "fool-vot": "siammask_vot",
    "fool-vot18": "siammask_vot18",
    "fool-davis": "siammask_davis",
}


def marker_tracker(name="siammask_r50_l3", **changes):
    networks = SiamMaskNetworks(Stub(kernels), marker_features(), marker_refinement())
    return SiamMask(networks, replace(PARAMETERS[name], **changes))


@pytest.mark.parametrize("video", ["A", "B"])
@pytest.mark.parametrize("name", LOOPS)
def test_loop_is_the_reference(golden, monkeypatch, name, video):
    z = golden(of_this_opencv(f"loops/{name}_{video}"))
    frames, box = golden_video(video)
    template, search = Stub(kernels), fixed_features()
    networks = SiamMaskNetworks(template, search, fixed_refinement())
    tracker = SiamMask(networks, PARAMETERS[LOOPS[name]])
    indices, sides = recorded_indices(monkeypatch), recorded_crop_sides(monkeypatch)
    tracker.init(FrameView(frames[0]), box)
    tolerance = polygon_tolerance(z)
    for t, frame in enumerate(frames[1:]):
        track = tracker.update(FrameView(frame))
        assert track.box == pytest.approx(z["bbox"][t], abs=1e-5)
        assert track.score == pytest.approx(z["score"][t], abs=1e-6)
        assert corner_distance(track.corners, z["polygon"][t]) < tolerance
    assert indices == z["best_idx"].tolist()
    assert sides == z["crop_sizes"].tolist()
    assert_crops(z, template, search)


@pytest.mark.parametrize("name", ["siammask_r50_l3", "fool-vot"])
@pytest.mark.parametrize("video", ["A", "B"])
def test_mask_is_the_reference(golden, name, video):
    z = golden(of_this_opencv(f"loops/{name}_{video}"))
    frames, box = golden_video(video, 2)
    networks = SiamMaskNetworks(Stub(kernels), fixed_features(), fixed_refinement())
    parameters = PARAMETERS[LOOPS[name]]
    tracker = SiamMask(networks, parameters)
    tracker.init(FrameView(frames[0]), box)
    mask = tracker.update(FrameView(frames[1])).mask
    assert mask.shape == (240, 320)
    assert mask.dtype == bool
    expected = z["mask_in_img_t1"]
    clear = abs(expected - parameters.mask_threshold) > 1e-5
    np.testing.assert_array_equal(
        mask[::2, ::2][clear], (expected > parameters.mask_threshold)[clear]
    )


@pytest.mark.parametrize("name", ["siammask_r50_l3", "siammask_e", "siammask_vot"])
def test_an_empty_mask_gives_the_upright_box(name):
    frames, box = golden_video("A", 2)
    empty = Stub(lambda t, *windows: [np.full((1, 127 * 127), -12, np.float32)])
    tracker = SiamMask(SiamMaskNetworks(Stub(kernels), fixed_features(), empty), PARAMETERS[name])
    tracker.init(FrameView(frames[0]), box)
    track = tracker.update(FrameView(frames[1]))
    np.testing.assert_allclose(track.corners, corners_from_xywh(track.box))
    assert not track.mask.any()


@pytest.mark.parametrize(("variant", "center_x"), [("pysot", 320.0), ("siammask", 330.2)])
def test_an_empty_mask_beyond_the_border(variant, center_x):
    """The authors' loop returns the unclamped box, pysot's the clamped one."""
    maps = fixed_features()

    def beyond(t, *inputs):
        cls, loc, *features = maps(*inputs)
        cls[:], loc[:] = 0, 0
        cls[0, 7, 12, 17] = 8  # five cells (40 px of the crop) to the right of the center
        return [cls, loc, *features]

    empty = Stub(lambda t, *windows: [np.full((1, 127 * 127), -12, np.float32)])
    networks = SiamMaskNetworks(Stub(kernels), Stub(beyond), empty)
    tracker = SiamMask(networks, replace(PARAMETERS["siammask_r50_l3"], variant=variant))
    start = (285.0, 100.0, 40.0, 40.0)
    tracker.init(FrameView(marker_frame(start)), start)
    track = tracker.update(FrameView(marker_frame(start)))
    assert track.box[0] + track.box[2] / 2 == 320
    assert track.corners[:, 0].mean() == pytest.approx(center_x, abs=0.1)


TILTED = (130.0, 100.0, 70.0, 35.0)


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("stab_from_raw", [pytest.param(np.eye(3), id="off"), *TRANSFORMS])
def test_mask_and_corners_follow_the_view(name, stab_from_raw):
    frame = marker_frame(TILTED, angle=30)
    rows, columns = np.nonzero((frame == (255, 0, 255)).all(axis=2))
    truth = cv2.boxPoints(((165 - 0.5, 117.5 - 0.5), (70, 35), 30))
    tracker = marker_tracker(name)
    tracker.init(FrameView(frame), TILTED)
    view = FrameView(frame, stab_from_raw, border=20)
    for _ in range(4):
        track = tracker.update(view)
    raw = track.mapped(view.raw_from_stab, SIZE)
    found = np.argwhere(raw.mask)
    assert len(found) == pytest.approx(len(rows), rel=0.15)
    np.testing.assert_allclose(found.mean(axis=0), (rows.mean(), columns.mean()), atol=1.5)
    overlap, _ = cv2.intersectConvexConvex(truth.astype(np.float32), raw.corners.astype(np.float32))
    union = 70 * 35 + cv2.contourArea(raw.corners.astype(np.float32)) - overlap
    assert overlap / union > 0.8


def test_a_mask_is_not_cut_at_the_edges_of_a_stabilized_view():
    """The view is shifted to the left: a part of the raw frame is outside of it."""
    box = (2.0, 100.0, 60.0, 40.0)
    frame = marker_frame(box)
    stab_from_raw = rigid(-15, 0, 0.0)
    tracker = marker_tracker()
    tracker.init(FrameView(frame), box)
    for _ in range(3):
        track = tracker.update(FrameView(frame, stab_from_raw, border=20))
    corners = map_points(np.linalg.inv(stab_from_raw), track.corners)
    assert corners[:, 0].min() == pytest.approx(2, abs=3)
    assert track.mask.shape == (240, 320)


def test_a_border_has_no_effect_on_a_raw_view():
    """Results on the raw frame are the reference's."""
    frames, box = golden_video("B", 6)
    runs = []
    for border in (0, 20):
        networks = SiamMaskNetworks(Stub(kernels), fixed_features(), fixed_refinement())
        tracker = SiamMask(networks, PARAMETERS["siammask_r50_l3"])
        tracker.init(FrameView(frames[0], border=border), box)
        runs.append([tracker.update(FrameView(f, border=border)).corners for f in frames[1:]])
    np.testing.assert_array_equal(*runs)


class TestOnMarker(LoopTests):
    def tracker(self):
        return marker_tracker()

    def test_every_track_has_mask_and_corners(self):
        tracker, frames = self.started()
        track = tracker.update(FrameView(frames[1]))
        assert track.mask.any()
        assert track.corners.shape == (4, 2)
        assert track.box[2] == pytest.approx(BOX[2], abs=4)
