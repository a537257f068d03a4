"""A shaking clip of a moving and a static patch, with their true boxes."""

from __future__ import annotations

import cv2
import numpy as np

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam.geometry import map_box
from ssiam.video import VideoSink

SIZE = (320, 240)
RATE = 10  # frames per second, few enough for slow machines
FRAMES = 300
# 3 s; late enough that a slow machine can pause before it.
HIDDEN = range(50, 80)
WALKER, STANDER = (44, 40), (40, 44)  # width, height
_STANDER_AT = (220, 150)


def write_shaking_clip(path, count, hidden=range(0)):
    """Write the clip; returns {"walker", "stander"}: the boxes in each frame.

    The walker is hidden in the frames `hidden`.
    """
    r = generator(8)
    background = world(8, SIZE)
    walker, stander = (
        cv2.resize(r.integers(0, 256, (5, 6, 3), np.uint8), s) for s in (WALKER, STANDER)
    )
    paste(background, stander, _STANDER_AT)
    waves = [
        (5 * np.sin(0.9 * k), 4 * np.cos(0.7 * k), 0.008 * np.sin(0.5 * k)) for k in range(count)
    ]
    boxes = {"walker": [], "stander": []}
    with VideoSink(path, RATE) as sink:
        for index, pose in enumerate(poses(waves, SIZE)):
            position = 60 + min(index, 140), 60 + index // 6
            scene = background.copy()
            if index not in hidden:
                paste(scene, walker, position)
            sink.write(camera_frame(scene, pose))
            boxes["walker"].append(map_box(pose, (*position, *WALKER)))
            boxes["stander"].append(map_box(pose, (*_STANDER_AT, *STANDER)))
    return boxes


def paste(scene, patch, position):
    """Paste a patch into a scene with its upper left corner at `position`."""
    (x, y), (height, width) = position, patch.shape[:2]
    scene[y : y + height, x : x + width] = patch


def distance(a, b):
    """Distance between the centers of two boxes, pixels."""
    return float(np.hypot(a[0] + a[2] / 2 - b[0] - b[2] / 2, a[1] + a[3] / 2 - b[1] - b[3] / 2))
