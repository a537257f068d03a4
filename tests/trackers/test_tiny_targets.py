"""Targets of a few pixels: boxes of their size, or lower scores."""

import cv2
import numpy as np
import pytest

import ssiam
from helpers.stub_networks import MARKER, Stub, kernels, marker_maps
from helpers.synthetic import generator
from ssiam import FrameView
from ssiam.geometry import iou
from ssiam.trackers.box_mask import PastedMask, rotated_box
from ssiam.trackers.siamese import TargetState, min_size, min_size_iou
from ssiam.trackers.siamrpn import SiamRpn, SiamRpnNetworks, SiamRpnParameters


def drawn(side, shake, count=16):
    """Frames (360, 640, 3) of a bright square on a shaking background, and its boxes."""
    random = generator(3)
    noise = random.integers(0, 255, (700, 1000, 3), dtype=np.uint8)
    background = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 6), None, 60, 160, cv2.NORM_MINMAX)
    path = random.normal(0, shake / 2, (count, 2)).cumsum(axis=0)
    path += random.normal(0, shake, (count, 2))
    frames, boxes = [], []
    for index, (ox, oy) in enumerate(np.round(150 + path).astype(int).tolist()):
        frame = background[oy : oy + 360, ox : ox + 640].copy()
        x, y = int(470 + 1.5 * index - ox), int(330 + 0.7 * index - oy)
        frame[y : y + side, x : x + side] = 240, 240, 250
        frames.append(frame)
        boxes.append((x, y, side, side))
    return frames, boxes


def tracked(tracker, side, shake=4):
    """Overlaps with the truth, and scores."""
    frames, boxes = drawn(side, shake)
    tracker.init(frames[0], boxes[0])
    tracks = [tracker.update(frame) for frame in frames[1:]]
    overlaps = iou([track.box for track in tracks], boxes[1:])
    return overlaps, np.array([track.score for track in tracks])


@pytest.mark.parametrize("side", [4, 6, 8, 12])
@pytest.mark.parametrize(("stabilize", "shake"), [("predict", 4), ("off", 0)])
def test_lite_reports_tiny_boxes_for_tiny_targets(side, stabilize, shake):
    overlaps, scores = tracked(ssiam.load_tracker(stabilize=stabilize), side, shake)
    assert overlaps.min() > 0.6
    assert scores.mean() > 0.8


@pytest.mark.parametrize("version", ["v1", "v2", "v3"])
@pytest.mark.parametrize("side", [6, 8])
def test_nanotracks_score_accounts_for_the_minimum_size(shared, version, side):
    weights = shared(f"data/weights/nanotrack{version}")
    tracker = ssiam.load_tracker(f"nanotrack_{version}", weights=weights)
    overlaps, scores = tracked(tracker, side)
    assert abs((overlaps > 0.5).mean() - scores.mean()) < 0.35


def marked(side):
    frame = np.full((240, 320, 3), 90, np.uint8)
    frame[100 : 100 + side, 150 : 150 + side] = MARKER
    return frame


@pytest.mark.parametrize("side", [5, 6, 8, 16, 30])
def test_siamrpn_keeps_the_references_minimum_size_and_lowers_its_score(side):
    networks = SiamRpnNetworks(Stub(kernels), marker_maps())
    tracker = SiamRpn(networks, SiamRpnParameters(0.05, 0.42, 0.38))
    box = (150.0, 100.0, float(side), float(side))
    tracker.init(FrameView(marked(side)), box)
    for _ in range(8):
        track = tracker.update(FrameView(marked(side)))
    assert min(track.box[2:]) >= 10
    overlap = iou(track.box, box)
    if side >= 16:
        assert overlap > 0.75
        assert track.score > 0.99
    else:
        assert track.score == pytest.approx((side / 10) ** 2, abs=0.12)
        assert (track.score > 0.5) == (overlap > 0.5)


@pytest.mark.parametrize(
    ("first", "expected"),
    [((6, 8), (3, 4)), ((12, 40), (6, 10)), ((1, 1), (1, 1)), ((300, 20), (10, 10))],
)
def test_the_minimum_size_follows_the_first_box(first, expected):
    assert min_size(first) == expected


def test_only_boxes_of_the_minimum_size_lower_the_score():
    state = TargetState((50.0, 50.0), (10.0, 30.0))
    assert min_size_iou(state, np.array([5.0, 15.0])) == 0.5
    assert min_size_iou(state, np.array([12.0, 15.0])) == 1.0
    assert min_size_iou(state, np.array([5.0, 15.0]), (4.0, 10.0)) == 1.0


@pytest.mark.parametrize("size", [(14, 6), (48, 24)])
def test_masks_below_100_pixels_also_get_a_rotated_box(size):
    mask = np.zeros((80, 80), np.uint8)
    corners = cv2.boxPoints(((40.0, 40.0), size, 30.0))
    cv2.fillPoly(mask, [np.round(corners).astype(np.int32)], 1)
    rows, columns = np.nonzero(mask)
    x, y = columns.min(), rows.min()
    xywh = (float(x), float(y), float(np.ptp(columns) + 1), float(np.ptp(rows) + 1))
    found = rotated_box(PastedMask(mask.astype(bool), (0, 0)), xywh)
    edges = np.roll(found, -1, axis=0) - found
    slant = np.abs(edges / np.linalg.norm(edges, axis=1)[:, None]).min(axis=1)
    assert (slant > 0.2).all()
