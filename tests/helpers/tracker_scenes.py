"""A drawn scene with a textured target that can be covered, filmed by a moving camera."""

import cv2
import numpy as np

from helpers.synthetic import generator, world
from ssiam.geometry import corners_from_xywh, frame_center, map_box, rigid
from ssiam.track import Track

SIZE = (400, 300)
SCENE = world(3, (800, 500))
TARGET = (380.0, 230.0, 44.0, 40.0)  # scene pixels
COVER = (360, 210, 84, 80)


def textured(seed, size_wh):
    """An image of large blocks, unlike the scene."""
    blocks = generator(seed).integers(0, 256, (5, 5, 3)).astype(np.uint8)
    return cv2.resize(blocks, size_wh, interpolation=cv2.INTER_NEAREST)


def with_patch(image, patch, x, y):
    image = image.copy()
    image[y : y + patch.shape[0], x : x + patch.shape[1]] = patch
    return image


OPEN = with_patch(SCENE, textured(11, (44, 40)), 380, 230)
COVERED = with_patch(OPEN, world(21, COVER[2:]), *COVER[:2])
OTHER_SCENE = world(40, (800, 500))


def shaking_pan(count, pan_frames=(), pan=90.0, shake=4.0, seed=6):
    """frame_from_scene of a camera that shakes, and pans away and back within `pan_frames`."""
    r = generator(seed)
    start = rigid((SIZE[0] - 800) / 2, (SIZE[1] - 500) / 2, 0)
    pan_x = np.zeros(count)
    if len(pan_frames):
        pan_x[list(pan_frames)] = -pan * np.sin(np.linspace(0, np.pi, len(pan_frames)))
    steps = r.normal(0, (shake, shake, 0.006), (count, 3))
    center = frame_center(SIZE)
    return [
        rigid(x + dx, dy, angle, center) @ start
        for x, (dx, dy, angle) in zip(pan_x, steps, strict=True)
    ]


def filmed(scene, frame_from_scene):
    return cv2.warpAffine(scene, frame_from_scene[:2], SIZE)


def target_box(frame_from_scene):
    return map_box(frame_from_scene, TARGET)


def distance(box, other):
    """Distance of two boxes' centers, in target sizes."""
    (x, y, w, h), (u, v, p, q) = box, other
    return np.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2) / np.sqrt(p * q)


class ScriptedTracker:
    """Finds the target within `reach` of the search position; otherwise stays, with a low score.

    `reach` is in target sizes.
    """

    can_seek, reseek_below = True, 0.0
    reach = 1.5

    def __init__(self, frames, truth):
        """`truth` has the target's raw box in each frame, None where it is hidden."""
        self._truth = {id(frame): box for frame, box in zip(frames, truth, strict=True)}

    def init(self, view, xywh):
        self._xywh = xywh

    def update(self, view):
        truth = self._truth[id(view.raw)]
        visible = None if truth is None else map_box(view.stab_from_raw, truth)
        if visible is None or distance(visible, self._xywh) >= self.reach:
            self._xywh = self.position_without_target()
            return self.result(0.02)
        self._xywh = visible
        return self.result(0.95)

    def position_without_target(self):
        return self._xywh

    def result(self, score):
        mask = np.ones((SIZE[1], SIZE[0]), bool)
        return Track(self._xywh, score, False, corners_from_xywh(TARGET), mask)

    def seek(self, view, xywh):
        self._xywh = xywh
        return self.update(view)
