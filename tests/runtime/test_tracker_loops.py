"""Complete trackers with their networks in PyTorch, compared with the reference trackers.

With the environment variable SSIAM_SLOW all trackers run on all frames.
"""

import cv2
import numpy as np
import pytest

pytest.importorskip("torch")

from helpers.network_models import SLOW, checkpoint
from helpers.synthetic import golden_video
from helpers.tracker_loops import corner_distance, recorded_indices
from ssiam import FrameView
from ssiam.runtime import RuntimeOptions
from ssiam.trackers.registry import load_siamese_tracker

FRAMES = 12  # of the golden loops
MIN_MARGIN = 1e-4  # score margin below which another candidate may win
# px: one mask pixel may be at the threshold, and OpenCV 4 pastes masks differently.
MAX_CORNER_DISTANCE = 1.5 if cv2.__version__.startswith("5") else 3.0

LOOPS = {  # golden loop: tracker, golden network, frames without SSIAM_SLOW
    "siamfc": ("siamfc", "siamfc", 6),
    "siamrpn_alex_dwxcorr": ("siamrpn_alex_dwxcorr",) * 2 + (12,),
    "siamrpn_mobilev2_l234_dwxcorr": ("siamrpn_mobilev2_l234_dwxcorr",) * 2 + (6,),
    "siamrpn_r50_l234_dwxcorr": ("siamrpn_r50_l234_dwxcorr",) * 2 + (4,),
    "siammask_r50_l3": ("siammask_r50_l3",) * 2 + (4,),
    "siammask_e": ("siammask_e", "siammask_r50_l3", 6),
    "fool-vot": ("siammask_vot", "foolwood_siammask_sharp", 4),
}


@pytest.mark.parametrize("loop", LOOPS)
def test_boxes_and_scores_match_the_reference(golden, monkeypatch, loop):
    name, network, count = LOOPS[loop]
    z = golden(f"loops/net_{loop}_A.npz")
    frames, box = golden_video("A", FRAMES)
    tracker = load_siamese_tracker(name, checkpoint(network), RuntimeOptions("torch"))
    indices = recorded_indices(monkeypatch)
    tracker.init(FrameView(frames[0]), box)
    for t, frame in enumerate(frames[1 : None if SLOW else count]):
        track = tracker.update(FrameView(frame))
        if name == "siamfc":
            x, y, w, h = track.box
            assert (x + 1, y + 1, w, h) == pytest.approx(z["box_1based"][t], abs=1e-3)
            continue
        if np.min(z["margin"][: t + 1]) <= MIN_MARGIN and indices[t] != z["best_idx"][t]:
            break
        assert indices[t] == z["best_idx"][t]
        assert track.box == pytest.approx(z["bbox"][t], abs=1e-3)
        assert track.score == pytest.approx(z["score"][t], abs=1e-5)
        if "polygon" in z:
            assert corner_distance(track.corners, z["polygon"][t]) < MAX_CORNER_DISTANCE
