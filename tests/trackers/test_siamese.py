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
    boxes_from_distances,
    clamped_state,
    cosine_window,
    crop_corner,
    crop_tensor,
    flattened,
    foreground_probability,
    grid_points,
    min_size,
    min_size_iou,
    next_state,
    ranked_candidates,
    sigmoid,
    updated_state,
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
        ranked, penalty = ranked_candidates(boxes, score, size, window, SIAMRPN)
        best = int(np.argmax(ranked))
        assert best == z[f"{video}_best_idx"][t - 1]
        rate = penalty[best] * score[best] * SIAMRPN.lr
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


def test_states_of_given_and_reported_boxes():
    """A given box has its center at (w - 1) / 2, a reported one at w / 2."""
    box = (10.0, 20.0, 30.0, 50.0)
    given, reported = TargetState.from_xywh(box), TargetState.from_reported_xywh(box)
    assert given.center_xy == (24.5, 44.5)
    assert reported.center_xy == (25.0, 45.0)
    assert given.size_wh == reported.size_wh == (30.0, 50.0)
    assert reported.xywh == box
    assert given.xywh == (9.5, 19.5, 30.0, 50.0)


def test_the_context_is_half_of_width_and_height():
    assert TargetState((0, 0), (40.0, 40.0)).context_side == pytest.approx(80)
    assert TargetState((0, 0), (20.0, 60.0)).context_side == pytest.approx(np.sqrt(60 * 100))


@pytest.mark.parametrize(
    ("size", "minimum"),
    [
        ((40.0, 20.0), (10.0, 10.0)),
        ((19.0, 12.0), (9.5, 6.0)),
        ((2.0, 1.0), (1.0, 1.0)),
        ((3.0, 100.0), (1.5, 10.0)),
    ],
)
def test_the_minimum_is_half_of_a_small_first_box(size, minimum):
    assert min_size(size) == minimum


def test_sizes_are_clamped_to_the_minimum_and_the_frame():
    view = FrameView(np.zeros((100, 200, 3), np.uint8))
    for size, clamped in (((3, 4), (10, 10)), ((300, 300), (200, 100)), ((50, 60), (50, 60))):
        assert clamped_state(TargetState((5.0, 6.0), size), view).size_wh == clamped
    state = clamped_state(TargetState((5.0, 6.0), (3.0, 4.0)), view, (2.0, 5.0))
    assert state.size_wh == (3.0, 5.0)
    assert state.center_xy == (5.0, 6.0)
    for center, inside in (((-3.0, 50.0), (0, 50)), ((201.0, 101.0), (200, 100))):
        assert clamped_state(TargetState(center, (20.0, 20.0)), view).center_xy == inside


def test_the_center_of_a_stabilized_view_is_clamped_at_each_edge():
    view = FrameView(np.zeros((100, 200, 3), np.uint8), rigid(10, -5, 0))
    for center, inside in (
        ((10.0, -5.0), (10, -5)),
        ((9.0, -6.0), (10, -5)),
        ((210.0, 95.0), (210, 95)),
        ((211.0, 96.0), (210, 95)),
        ((100.0, 96.0), (100, 95)),
        ((9.0, 20.0), (10, 20)),
    ):
        found = clamped_state(TargetState(center, (20.0, 20.0)), view).center_xy
        assert found == pytest.approx(inside)


@pytest.mark.parametrize(
    ("size", "candidate", "overlap"),
    [
        ((20.0, 20.0), (3, 3), 1),
        ((10.0, 20.0), (5, 3), 0.5),
        ((10.0, 10.0), (5, 8), 0.4),
        ((10.0, 10.0), (12, 11), 1),
        ((20.0, 10.0), (5, 2.5), 0.25),
    ],
)
def test_a_box_of_the_minimum_size_overlaps_its_candidate_only_in_part(size, candidate, overlap):
    state = TargetState((0.0, 0.0), size)
    assert min_size_iou(state, np.array(candidate, float)) == pytest.approx(overlap)
    assert min_size_iou(state, np.array(candidate, float), (1.0, 1.0)) == 1


def test_size_and_position_follow_a_candidate():
    state = TargetState((50.0, 60.0), (20.0, 40.0))
    after = updated_state(state, np.array([4.0, -8.0, 80.0, 20.0]), 2.0, 0.25)
    assert after.center_xy == (52, 56)
    assert after.size_wh == (25, 32.5)


def test_changes_of_size_and_aspect_are_penalized():
    parameters = SearchParameters(penalty_k=0.5, window_influence=0.0, lr=1.0)
    size = np.array([40.0, 20.0])

    def penalty(w, h):
        boxes = np.array([[0.0], [0], [w], [h]])
        return ranked_candidates(boxes, np.ones(1), size, np.ones(1), parameters)[1].item()

    assert penalty(40, 20) == 1
    assert penalty(80, 40) == penalty(20, 10) == pytest.approx(np.exp(-0.5))
    assert penalty(20, 40) == pytest.approx(np.exp(-3 * 0.5))  # a fourth of the aspect ratio


def test_the_window_prefers_near_candidates():
    boxes = np.array([[0.0, 50], [0, 0], [40, 40], [20, 20]])
    score, window, size = np.array([0.6, 0.8]), np.array([1.0, 0.0]), np.array([40.0, 20.0])
    for influence, best in ((0.0, 1), (0.1, 1), (0.2, 0), (1.0, 0)):
        parameters = SearchParameters(0.1, influence, 0.3)
        ranked, penalty = ranked_candidates(boxes, score, size, window, parameters)
        assert np.argmax(ranked) == best
        assert penalty.tolist() == [1.0, 1.0]


def test_boxes_of_distances():
    distances = np.zeros((1, 4, 2, 2), np.float32)
    distances[0, :, 0, 1] = 1, 2, 5, 8
    points = grid_points(np.array([-4.0, 4.0]))
    np.testing.assert_array_equal(points, [[-4, 4, -4, 4], [-4, -4, 4, 4]])
    boxes = boxes_from_distances(distances, points)
    np.testing.assert_array_equal(boxes[:, 1], [4 + 2, -4 + 3, 6, 10])
    np.testing.assert_array_equal(boxes[:, 2], [-4, 4, 0, 0])


def test_tensors_and_probabilities():
    crop = np.arange(2 * 2 * 3, dtype=np.uint8).reshape(2, 2, 3)
    tensor = crop_tensor(crop)
    assert (tensor.shape, tensor.dtype, tensor.flags.c_contiguous) == ((1, 3, 2, 2), np.float32, 1)
    np.testing.assert_array_equal(tensor[0, 2], [[2, 5], [8, 11]])
    vector = flattened([tensor, np.float32([[7]])])
    assert vector.dtype == np.float64
    assert vector.tolist() == [0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11, 7]
    maps = np.float32([[[[0.0, 2]], [[1.0, -3]]]])
    np.testing.assert_allclose(foreground_probability(maps), 1 / (1 + np.exp([-1, 5])))
    logits = np.float32([[[[0.0, 3], [-2, 100]]]])
    np.testing.assert_allclose(sigmoid(logits), 1 / (1 + np.exp([0.0, -3, 2, -100])))
    np.testing.assert_allclose(cosine_window(3), [0, 0, 0, 0, 1, 0, 0, 0, 0], atol=1e-12)
    assert cosine_window(5)[7] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("center", "side", "corner"),
    [
        ((100.0, 80.0), 20, (90, 70)),
        ((100.0, 80.0), 21, (89, 69)),
        ((100.5, 80.4), 20, (90, 70)),
        ((100.5, 80.4), 21, (90, 69)),
    ],
)
def test_the_corner_of_a_crop(center, side, corner):
    assert tuple(crop_corner(center, side)) == corner
