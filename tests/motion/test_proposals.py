"""Proposals: moving objects of the example clip, still objects, and frames without any."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.synthetic import camera_frame, poses, world
from ssiam.geometry import iou, map_box
from ssiam.motion import proposals
from ssiam.motion.proposals import (
    MOST,
    _aligned,
    _contrast,
    _difference,
    _groups,
    _objects,
    _overlap,
    _reduced,
    _scaled,
    _span,
    _warped,
    propose_boxes,
)
from ssiam.video import open_source

EXAMPLES = Path(__file__).parents[2] / "examples"


def best(boxes, truth):
    """Position and IoU of the box that fits best."""
    found = [float(np.ravel(iou(box, truth))[0]) for box in boxes]
    return int(np.argmax(found)), max(found)


@pytest.fixture(scope="module")
def walk():
    frames = [frame.image for frame in open_source(EXAMPLES / "shaky-walker.mp4")]
    lines = (EXAMPLES / "shaky-walker.txt").read_text().splitlines()
    return frames, [tuple(map(float, line.split(","))) for line in lines]


@pytest.mark.parametrize("start", [0, 30])
def test_the_walker_is_among_the_first_proposals(walk, start):
    frames, boxes = walk
    position, overlap = best(propose_boxes(frames[start:]), boxes[start])
    assert overlap > 0.6
    assert position < 5


def test_boxes_are_in_pixels_of_the_raw_frame(walk):
    frames, boxes = walk
    large = [cv2.resize(frame, None, fx=2, fy=2) for frame in frames[:49]]
    _, overlap = best(propose_boxes(large), tuple(2 * value for value in boxes[0]))
    assert overlap > 0.6


def test_a_small_object_that_moves_while_the_camera_shakes():
    r = np.random.default_rng(4)
    background, patch = world(4, (320, 240)), r.integers(0, 256, (24, 18, 3)).astype(np.uint8)
    frames = []
    frame_from_world = poses(r.normal(0, (4, 4, 0.01), (49, 3)), (320, 240))
    for index, pose in enumerate(frame_from_world):
        scene = background.copy()
        scene[90:114, 60 + 2 * index : 78 + 2 * index] = patch
        frames.append(camera_frame(scene, pose))
    truth = map_box(frame_from_world[0], (60, 90, 18, 24))
    position, overlap = best(propose_boxes(frames), truth)
    assert position == 0
    assert overlap > 0.6


def test_a_still_object_in_a_single_image():
    image = np.full((240, 320, 3), 90, np.uint8)
    image[100:140, 200:230] = (30, 40, 220)
    _, overlap = best(propose_boxes([image]), (200, 100, 30, 40))
    assert overlap > 0.7


@pytest.mark.parametrize(
    "frames",
    [
        pytest.param([np.full((48, 64, 3), 90, np.uint8)] * 20, id="one color"),
        pytest.param([np.zeros((2, 2, 3), np.uint8)], id="tiny"),
        pytest.param([np.zeros((1, 1000, 3), np.uint8)] * 3, id="one row"),
    ],
)
def test_nothing_stands_out(frames):
    assert propose_boxes(frames) == []


def test_noise_and_cuts_give_valid_boxes():
    r = np.random.default_rng(5)
    frames = [r.integers(0, 256, (120, 160, 3)).astype(np.uint8) for _ in range(20)]
    boxes = propose_boxes(frames)
    assert len(boxes) <= MOST
    assert all(x >= 0 and y >= 0 and x + w <= 160 and y + h <= 120 for x, y, w, h in boxes)


def test_the_frames_given_are_not_changed(walk):
    frames = walk[0][:20]
    before = [frame.copy() for frame in frames]
    propose_boxes(frames)
    assert all(np.array_equal(a, b) for a, b in zip(before, frames, strict=True))


def in_color(gray):
    return np.repeat(np.asarray(gray, np.uint8)[..., None], 3, axis=2)


@pytest.mark.parametrize(
    ("size", "small"),
    [
        ((640, 360), (640, 360)),
        ((641, 360), (640, 359)),
        ((1280, 720), (640, 360)),
        ((720, 1280), (360, 640)),
        ((3000, 2), (640, 1)),
        ((2, 3000), (1, 640)),
    ],
)
def test_large_frames_are_reduced(size, small):
    frame = in_color(np.arange(size[0] * size[1]).reshape(size[1], size[0]) % 251)
    found = _reduced(frame)
    assert found.shape[1::-1] == small
    if size == small:
        assert found is frame
    else:
        expected = cv2.resize(frame, small, interpolation=cv2.INTER_AREA)
        np.testing.assert_array_equal(found, expected)


def test_every_sixth_frame_is_aligned():
    scene = world(2, (400, 300))
    frames = [np.ascontiguousarray(scene[:240, t : t + 320]) for t in range(80)]
    given = iter(frames)
    first, *aligned = _aligned(given)
    assert first is frames[0]
    assert len(aligned) == 8
    assert next(given) is frames[49], "the rest is not read"
    for index, image in enumerate(aligned, 1):
        known = np.isfinite(image[..., 0])
        assert known[:, : 6 * index - 1].sum() == 0
        assert known[10:-10, 6 * index + 2 : -2].all()
        difference = np.abs(image - frames[0])[known]
        assert np.median(difference) < 2


def test_frames_after_a_cut_are_not_used():
    scene, other = world(2, (320, 240)), world(7, (320, 240))
    assert len(_aligned([*[scene] * 13, *[other] * 30])) == 1 + 2
    assert len(_aligned([*[scene] * 12, *[other] * 30])) == 1 + 1
    assert len(_aligned([scene])) == 1


def test_pixels_outside_of_a_frame_are_unknown():
    image = world(2, (64, 48))
    found = _warped(image, np.array([[1.0, 0, 5], [0, 1, -3], [0, 0, 1]]))
    assert (found.dtype, found.shape) == (np.float32, (48, 64, 3))
    expected = np.full((48, 64, 3), np.nan)
    expected[3:, :-5] = image[:-3, 5:]
    np.testing.assert_array_equal(found, expected)


def disks(*centers, size=(120, 80), radius=12):
    """A map that falls from 30 in the middle of each disk to 1 outside."""
    y, x = np.mgrid[: size[1], : size[0]]
    peaks = [30 - 29 * np.minimum(np.hypot(x - u, y - v) / radius, 1) for u, v in centers]
    return np.max([np.ones(size[::-1]), *peaks], axis=0).astype(np.float32)


def test_objects_of_a_map_the_strongest_first():
    ratio = disks((30, 40))
    ratio[40:70, 80:110] = 3
    small, large = _objects(ratio)
    assert small == pytest.approx((19, 29, 23, 23), abs=1)
    assert large == (80, 40, 30, 30)
    ratio[40:70, 80:110] = 8
    assert [each[0] for each in _objects(ratio)] == [80, small[0]]


def test_a_group_falls_apart_where_the_map_is_low_between_its_parts():
    ratio = disks((40, 40), (60, 40))
    assert len(_groups(ratio > 2, close=True)) == 1
    left, right = sorted(_objects(ratio))
    assert left[0] + left[2] <= right[0]


def test_parts_of_less_than_a_fifth_are_no_objects():
    ratio = np.full((80, 160), 1, np.float32)
    ratio[20:60, 10:110] = 2.5
    ratio[20:60, 10:60] = 5
    for width, count in ((25, 2), (12, 1)):
        both = ratio.copy()
        both[20:60, 80 : 80 + width] = 5
        assert len(_objects(both)) == count


def test_groups_of_at_least_eight_pixels():
    mask = np.zeros((60, 80), bool)
    mask[5:13, 5:13] = True
    mask[5:12, 30:50] = True
    mask[30:50, 5:12] = True
    (found,) = _groups(mask, close=False)
    assert found.sum() == pytest.approx(64, abs=4)
    assert _groups(np.zeros((60, 80), bool), close=True) == []


def test_gaps_are_closed_and_bridges_are_cut():
    """Of an object, gaps of up to six rows or four columns; bridges of up to two pixels."""
    for gap, count in ((6, 1), (7, 2)):
        mask = np.zeros((80, 80), bool)
        mask[10:25, 20:40] = mask[25 + gap : 50, 20:40] = True
        assert len(_groups(mask, close=True)) == count
        assert len(_groups(mask, close=False)) == 2
    for gap, count in ((4, 1), (5, 2)):
        mask = np.zeros((80, 80), bool)
        mask[20:40, 10:25] = mask[20:40, 25 + gap : 50] = True
        assert len(_groups(mask, close=True)) == count
    for width, count in ((2, 2), (3, 1)):
        mask = np.zeros((80, 80), bool)
        mask[20:40, 10:25] = mask[20:40, 45:60] = True
        mask[30 : 30 + width, 25:45] = True
        assert len(_groups(mask, close=False)) == count


def test_boxes_of_masks_and_their_overlap():
    mask = np.zeros((60, 80), bool)
    mask[10:31, 20:25] = True
    assert _span(mask) == (20, 10, 5, 21)
    assert all(type(value) is int for value in _span(mask))
    assert _overlap((0, 0, 10, 10), (5, 5, 10, 20)) == 0.25
    assert _overlap((0, 0, 40, 40), (10, 20, 5, 4)) == 1
    assert _overlap((0, 0, 10, 10), (10, 0, 10, 10)) == 0
    assert _overlap((0, 0, 10, 10), (20, 20, 10, 10)) == 0
    assert _overlap((20, 20, 10, 10), (0, 0, 21, 25)) == 0.05
    assert _scaled((1, 2, 3, 5), 1.5) == (2.0, 3.0, 4.0, 8.0)


def test_the_difference_from_the_background_in_noise_levels():
    """6 gray levels on a flat background; the largest of the three colors counts."""
    background = in_color(np.full((60, 80), 100))
    image = background.copy()
    image[20:40, 30:50] = (112, 100, 94)
    aligned = [background.astype(np.float32)] * 3
    found = _difference(image, aligned)
    assert found.dtype == np.float32
    assert found[30, 40] == pytest.approx(2)
    assert found[10, 10] == 0
    unknown = [np.full_like(each, np.nan) for each in aligned]
    assert not _difference(image, unknown).any()
    moved = [*aligned[:2], image.astype(np.float32)]
    np.testing.assert_allclose(_difference(image, moved), found)


def test_differences_at_edges_of_the_background_count_less():
    """By the slope in gray levels per pixel."""
    ramp = in_color(np.tile(4 * np.arange(60), (40, 1)))
    image = ramp.copy()
    image[15:25, 20:40] += 20
    found = _difference(image, [ramp.astype(np.float32)] * 2)
    assert found[20, 30] == pytest.approx(20 / (6 + 4), rel=0.01)


def test_contrast_is_relative_to_that_of_the_image():
    image = in_color(np.full((120, 160), 90))
    image[50:70, 70:90] = 200
    found = _contrast(image)
    assert found.dtype == np.float32
    lab = cv2.cvtColor(image, cv2.COLOR_BGR2LAB).astype(np.float32)
    contrast = np.linalg.norm(
        cv2.GaussianBlur(lab, (0, 0), 1.0) - cv2.GaussianBlur(lab, (0, 0), 9.6), axis=2
    )
    usual = max(contrast.mean(), 6.0)
    np.testing.assert_allclose(found, contrast / usual, rtol=1e-4, atol=1e-5)
    busy = world(3, (160, 120))
    assert _contrast(busy).mean() == pytest.approx(1)


def blocks(count, size=36):
    """A still image with bright squares in rows of five."""
    image = np.full((360, 640, 3), 60, np.uint8)
    for number in range(count):
        row, column = divmod(number, 5)
        y, x = 30 + 100 * row, 40 + 120 * column
        image[y : y + size, x : x + size] = 160
    return image


def test_at_most_nine_objects_are_proposed():
    assert len(propose_boxes([blocks(7)])) == 7
    assert len(propose_boxes([blocks(13)])) == 9


@pytest.mark.parametrize(("height", "count"), [(120, 1), (121, 0)])
def test_boxes_of_a_still_image_are_not_larger_than_a_fourth_of_it(monkeypatch, height, count):
    contrast = np.ones((240, 320), np.float32)
    contrast[40 : 40 + height, 60:220] = 3
    monkeypatch.setattr(proposals, "_contrast", lambda image: contrast)
    found = propose_boxes([np.zeros((240, 320, 3), np.uint8)])
    assert found == [(60, 40, 160, height)] * count


@pytest.mark.parametrize(("left", "count"), [(114, 2), (113, 1)])
def test_a_weaker_box_overlaps_by_at_most_three_tenths(monkeypatch, left, count):
    """Of a box of 20 px: 6 and 7 px."""
    spans = [(60, 40, 60, 60), (left, 50, 20, 20)]
    monkeypatch.setattr(proposals, "_objects", lambda ratio: spans)
    assert len(propose_boxes([np.zeros((240, 320, 3), np.uint8)])) == count


def test_boxes_are_scaled_to_the_frame(monkeypatch):
    monkeypatch.setattr(proposals, "_objects", lambda ratio: [(60, 40, 50, 30)])
    for size, factor in (((320, 240), 1), ((640, 360), 1), ((1280, 720), 2), ((720, 1280), 2)):
        frame = np.zeros((size[1], size[0], 3), np.uint8)
        assert propose_boxes([frame]) == [tuple(factor * v for v in (60, 40, 50, 30))]


def test_frames_before_the_second_aligned_one_are_a_still_image():
    """The background is the median of at least two frames."""
    scene = world(4, (320, 240))
    moving = []
    for t in range(13):
        frame = scene.copy()
        frame[100:130, 40 + 12 * t : 70 + 12 * t] = (0, 0, 255)
        moving.append(frame)
    position, overlap = best(propose_boxes(moving), (40, 100, 30, 30))
    assert (position, overlap > 0.7) == (0, True)
    assert propose_boxes(moving[:12]) == propose_boxes(moving[:1])
