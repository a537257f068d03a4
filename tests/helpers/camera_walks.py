"""Exact motions of a camera, exact boxes of a target, and what a `Prediction` makes of them."""

import numpy as np

from helpers.synthetic import generator, poses
from ssiam import Motion
from ssiam.geometry import map_box

SIZE = (640, 360)
BOX = (380.0, 90.0, 40.0, 50.0)
TARGET = np.sqrt(40.0 * 50.0)  # its size, pixels


def centre(xywh):
    return np.array([xywh[0] + xywh[2] / 2, xywh[1] + xywh[3] / 2])


def shaken(count=60, shift=9.0, angle=0.01, seed=5):
    return poses(generator(seed).normal(0, (shift, shift, angle), (count, 3)), SIZE)


def walking(step, count=60):
    return [(BOX[0] + t * step[0], BOX[1] + t * step[1], *BOX[2:]) for t in range(count)]


def in_raw(frame_from_world, boxes):
    """Boxes of the first frame's scene as each frame shows them."""
    start = np.linalg.inv(frame_from_world[0])
    return [map_box(pose @ start, box) for pose, box in zip(frame_from_world, boxes, strict=True)]


def motions(frame_from_world):
    pairs = zip(frame_from_world[1:], frame_from_world[:-1], strict=True)
    return [Motion.from_transform(cur @ np.linalg.inv(prev), SIZE) for cur, prev in pairs]


def predicted(prediction, frame_from_world, raw_boxes, score=1.0):
    """The expected box and the view of each frame but the first; every box is then observed."""
    expected, views = [], []
    for motion, box in zip(motions(frame_from_world), raw_boxes[1:], strict=True):
        expected.append(prediction.update(motion))
        views.append(prediction.stab_from_raw)
        prediction.observe(box, score)
    return expected, views


def off(expected, raw_boxes):
    """Distance of the expected places from the true ones, pixels."""
    pairs = zip(expected, raw_boxes[1:], strict=True)
    return np.array([np.hypot(*(centre(a) - centre(b))) for a, b in pairs])


STEP = (7.0, -3.0)  # px per frame, off the shake's scale and well above the margin
