"""A drawn world with a textured target that a cover can hide, seen by a camera that moves."""

import cv2
import numpy as np

from helpers.synthetic import generator, world
from ssiam.geometry import frame_center, map_box, rigid

SIZE = (400, 300)
SCENE = world(3, (800, 500))
TARGET = (380.0, 230.0, 44.0, 40.0)  # in the scene, pixels
COVER = (360, 210, 84, 80)


def textured(seed, size_wh):
    """A picture of bold blocks, unlike the scene's."""
    blocks = generator(seed).integers(0, 256, (5, 5, 3)).astype(np.uint8)
    return cv2.resize(blocks, size_wh, interpolation=cv2.INTER_NEAREST)


def pasted(scene, patch, x, y):
    scene = scene.copy()
    scene[y : y + patch.shape[0], x : x + patch.shape[1]] = patch
    return scene


OPEN = pasted(SCENE, textured(11, (44, 40)), 380, 230)
COVERED = pasted(OPEN, world(21, COVER[2:]), *COVER[:2])
ELSEWHERE = world(40, (800, 500))


def shaken_pan(count, pan_at=(), pan=90.0, shake=4.0, seed=6):
    """frame_from_scene of a camera that shakes, and pans away and back within `pan_at`."""
    r = generator(seed)
    middle = rigid((SIZE[0] - 800) / 2, (SIZE[1] - 500) / 2, 0)
    away = np.zeros(count)
    if len(pan_at):
        away[list(pan_at)] = -pan * np.sin(np.linspace(0, np.pi, len(pan_at)))
    steps = r.normal(0, (shake, shake, 0.006), (count, 3))
    centre = frame_center(SIZE)
    return [
        rigid(x + dx, dy, angle, centre) @ middle
        for x, (dx, dy, angle) in zip(away, steps, strict=True)
    ]


def shown(scene, frame_from_scene):
    return cv2.warpAffine(scene, frame_from_scene[:2], SIZE)


def target_in(frame_from_scene):
    return map_box(frame_from_scene, TARGET)


def apart(box, other):
    """Distance of two boxes' centres, in sizes of the target."""
    (x, y, w, h), (u, v, p, q) = box, other
    return np.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2) / np.sqrt(p * q)
