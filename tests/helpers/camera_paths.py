"""Exact camera motions and target boxes, and the predictions of a `TargetPredictor` for them."""

import numpy as np

from helpers.synthetic import generator, poses
from ssiam import Motion
from ssiam.geometry import map_box

SIZE = (640, 360)
BOX = (380.0, 90.0, 40.0, 50.0)
TARGET = np.sqrt(40.0 * 50.0)  # size of the box, pixels
STEP = (7.0, -3.0)  # px per frame: different from the shake, and well above the margin


def center(xywh):
    return np.array([xywh[0] + xywh[2] / 2, xywh[1] + xywh[3] / 2])


def shaken(count=60, shift=9.0, angle=0.01, seed=5):
    return poses(generator(seed).normal(0, (shift, shift, angle), (count, 3)), SIZE)


def walking(step, count=60):
    return [(BOX[0] + t * step[0], BOX[1] + t * step[1], *BOX[2:]) for t in range(count)]


def in_frames(frame_from_world, boxes):
    """Boxes in the scene of the first frame, mapped to each frame."""
    start = np.linalg.inv(frame_from_world[0])
    return [map_box(pose @ start, box) for pose, box in zip(frame_from_world, boxes, strict=True)]


def motions(frame_from_world):
    pairs = zip(frame_from_world[1:], frame_from_world[:-1], strict=True)
    return [Motion.from_transform(cur @ np.linalg.inv(prev), SIZE) for cur, prev in pairs]


def run_predictor(predictor, frame_from_world, raw_boxes, score=1.0):
    """The predicted box and the view of each frame but the first; every box is then observed."""
    boxes, views = [], []
    for motion, box in zip(motions(frame_from_world), raw_boxes[1:], strict=True):
        boxes.append(predictor.update(motion))
        views.append(predictor.stab_from_raw)
        predictor.observe(box, score)
    return boxes, views


def center_errors(predicted_boxes, raw_boxes):
    """Distance of the predicted centers from the true ones, pixels."""
    pairs = zip(predicted_boxes, raw_boxes[1:], strict=True)
    return np.array([np.hypot(*(center(a) - center(b))) for a, b in pairs])
