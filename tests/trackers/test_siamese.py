"""The shared steps of the Siamese loops, compared with SiamRPN++'s loop on fixed maps."""

import numpy as np
import pytest

from helpers.synthetic import generator, golden_video, world
from ssiam import FrameView
from ssiam.geometry import map_points, rigid
from ssiam.trackers.siamese import (
    TEMPLATE_SIDE,
    SearchParameters,
    TargetState,
    cosine_window,
    next_state,
    select_candidate,
)

SIDE, SEARCH_SIDE = 25, 255
SIAMRPN = SearchParameters(penalty_k=0.05, window_influence=0.42, lr=0.38)
ANCHORS = [(104, 32), (88, 40), (64, 64), (40, 80), (32, 96)]


def stub_candidates(t):
    """Boxes (4, 5 * 25 * 25) and scores of the reference's stub maps in frame t."""
    cls = generator(1000 + t).standard_normal((1, 10, SIDE, SIDE)).astype(np.float32)
    loc = (0.3 * generator(2000 + t).standard_normal((1, 20, SIDE, SIDE))).astype(np.float32)
    background, foreground = cls.reshape(2, -1).astype(np.float64)
    dx, dy, dw, dh = loc.reshape(4, -1).astype(np.float64)
    offsets = (np.arange(SIDE) - SIDE // 2) * 8.0
    x, y = (np.tile(grid.ravel(), 5) for grid in np.meshgrid(offsets, offsets))
    w, h = np.repeat(np.array(ANCHORS, dtype=float), SIDE * SIDE, axis=0).T
    boxes = np.stack([dx * w + x, dy * h + y, np.exp(dw) * w, np.exp(dh) * h])
    return boxes, 1 / (1 + np.exp(background - foreground))


@pytest.mark.parametrize("video", ["A", "B"])
def test_loop_is_the_reference(golden, video):
    z = golden("siamrpn_loop.npz")
    frames, box = golden_video(video)
    state = TargetState.from_xywh(box)
    assert round(state.context_side) == z[f"{video}_init_s_z"]
    np.testing.assert_allclose(frames[0].mean(axis=(0, 1)), z[f"{video}_channel_average"])
    window = np.tile(cosine_window(SIDE), 5)
    for t, frame in enumerate(frames[1:], start=1):
        zoom = TEMPLATE_SIDE / state.context_side
        assert round(SEARCH_SIDE / zoom) == z[f"{video}_s_x"][t - 1]
        boxes, score = stub_candidates(t)
        size = np.array(state.size_wh) * zoom
        best, penalty = select_candidate(boxes, score, size, window, SIAMRPN)
        assert best == z[f"{video}_best_idx"][t - 1]
        rate = penalty * score[best] * SIAMRPN.lr
        state = next_state(state, boxes[:, best], zoom, rate, FrameView(frame))
        assert state.center_xy == pytest.approx(z[f"{video}_center"][t - 1], abs=1e-5)
        assert state.size_wh == pytest.approx(z[f"{video}_size"][t - 1], abs=1e-5)
        assert state.xywh == pytest.approx(z[f"{video}_bbox"][t - 1], abs=1e-5)
        assert score[best] == pytest.approx(z[f"{video}_score"][t - 1], abs=1e-6)


def test_clipping_is_the_reference(golden):
    z = golden("functions.npz")
    view = FrameView(np.zeros((240, 320, 3), np.uint8))
    for (cx, cy, w, h), clipped in zip(z["clip_cases"], z["clip_out"], strict=True):
        state = TargetState((0.0, 0.0), (50.0, 50.0))
        after = next_state(state, np.array([cx, cy, w, h]), 1.0, 1.0, view)
        assert (*after.center_xy, *after.size_wh) == pytest.approx(clipped)


def test_centers_are_clamped_to_the_raw_frame():
    stab_from_raw = rigid(50, -30, 0.1, (319.5, 179.5))
    view = FrameView(world(), stab_from_raw)
    state = TargetState((100.0, 100.0), (40.0, 40.0))
    far = next_state(state, np.array([2000.0, 0.0, 40.0, 40.0]), 1.0, 1.0, view)
    raw = map_points(view.raw_from_stab, [far.center_xy])[0]
    assert raw[0] == pytest.approx(640)
    near = next_state(state, np.array([590.0, 40.0, 40.0, 40.0]), 1.0, 1.0, view)
    assert near.center_xy == (690.0, 140.0)  # beyond 640, but inside of the raw frame
