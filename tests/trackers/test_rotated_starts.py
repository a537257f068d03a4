"""Trackers that start on a rotated box, as in VOT: the first center is that of the corners."""

import numpy as np
import pytest

from helpers.stub_networks import Stub, fixed_features, fixed_refinement, kernels
from helpers.synthetic import golden_video
from helpers.tracker_loops import corner_distance, of_this_opencv, polygon_tolerance
from ssiam import StabilizedTracker, StabilizerConfig
from ssiam.geometry import corners_from_xywh, map_points, rigid
from ssiam.trackers.siammask import PARAMETERS, SiamMask, SiamMaskNetworks

LOOPS = {
    "siammask_r50_l3": "siammask_r50_l3",
    "siammask_e": "siammask_e",
    "siammask_vot": "fool-vot",
    "siammask_vot18": "fool-vot18",
    "siammask_davis": "fool-davis",
}


def started(name, frame, box):
    networks = SiamMaskNetworks(Stub(kernels), fixed_features(), fixed_refinement())
    view_tracker = SiamMask(networks, PARAMETERS[name])
    tracker = StabilizedTracker(view_tracker, StabilizerConfig("off"))
    tracker.init(frame, box)
    return tracker, view_tracker


@pytest.mark.parametrize("name", LOOPS)
def test_the_loop_on_a_polygon_is_the_reference(golden, name):
    """The references take the mean of a polygon's corners, and its sides plus one pixel."""
    z = golden(of_this_opencv(f"loops/{LOOPS[name]}_A"))
    frames, (x, y, w, h) = golden_video("A")
    inset = 0.5 if LOOPS[name].startswith("fool") else 0.0  # where the goldens' centers are
    polygon = corners_from_xywh((x + inset, y + inset, w - 1, h - 1)).ravel()
    tracker, _ = started(name, frames[0], polygon)
    for t, frame in enumerate(frames[1:]):
        track = tracker.update(frame)
        assert track.box == pytest.approx(z["bbox"][t], abs=1e-5)
        assert corner_distance(track.corners, z["polygon"][t]) < polygon_tolerance(z)


@pytest.mark.parametrize("name", LOOPS)
def test_the_first_center_is_that_of_the_corners(name):
    frames, _ = golden_video("A", 1)
    corners = map_points(rigid(90.3, 120.6, 0.4), [[-20, -30], [20, -30], [20, 30], [-20, 30]])
    _, view_tracker = started(name, frames[0], corners.ravel())
    assert view_tracker._target.state.center_xy == pytest.approx((90.3, 120.6))


def test_a_line_is_not_a_target():
    frames, _ = golden_video("A", 1)
    with pytest.raises(ValueError, match="is empty: its corners are on one line"):
        started("siammask_vot", frames[0], np.array([20.0, 30, 60, 30, 60, 30, 20, 30]))
