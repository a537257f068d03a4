"""Proposals: moving objects of the example clip, still objects, and frames without any."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.synthetic import camera_frame, poses, world
from ssiam.geometry import iou, map_box
from ssiam.motion.proposals import MOST, propose_boxes
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
