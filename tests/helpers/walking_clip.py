"""A shaking clip of a patch that walks and one that stands, whose truth is known."""

from __future__ import annotations

import cv2
import numpy as np

from helpers.synthetic import generator, poses, seen, world
from ssiam.geometry import map_box
from ssiam.video import VideoSink

SIZE = (320, 240)
RATE = 10  # frames a second: slow machines keep up
FRAMES = 300
# 1.5 s, and as long after the first frames as a slow machine needs to stop before it.
HIDDEN = range(50, 65)
WALKER, STANDER = (44, 40), (40, 44)  # width, height
_STANDS = (220, 150)


def write_shaking_clip(path, count, hidden=range(0)):
    """A patch that walks and one that stands; {"walker", "stander"}: their boxes, frame by frame.

    In the frames `hidden` the walker is not there.
    """
    r = generator(8)
    background = world(8, SIZE)
    walker, stander = (
        cv2.resize(r.integers(0, 256, (5, 6, 3), np.uint8), s) for s in (WALKER, STANDER)
    )
    paste(background, stander, _STANDS)
    waves = [
        (5 * np.sin(0.9 * k), 4 * np.cos(0.7 * k), 0.008 * np.sin(0.5 * k)) for k in range(count)
    ]
    boxes = {"walker": [], "stander": []}
    with VideoSink(path, RATE) as sink:
        for index, pose in enumerate(poses(waves, SIZE)):
            place = 60 + min(index, 140), 60 + index // 6
            scene = background.copy()
            if index not in hidden:
                paste(scene, walker, place)
            sink.write(seen(scene, pose))
            boxes["walker"].append(map_box(pose, (*place, *WALKER)))
            boxes["stander"].append(map_box(pose, (*_STANDS, *STANDER)))
    return boxes


def paste(scene, patch, place):
    """Lay a patch into a scene, its upper left corner at `place`."""
    (x, y), (height, width) = place, patch.shape[:2]
    scene[y : y + height, x : x + width] = patch


def distance(a, b):
    """Between the centres of two boxes, pixels."""
    return float(np.hypot(a[0] + a[2] / 2 - b[0] - b[2] / 2, a[1] + a[3] / 2 - b[1] - b[3] / 2))
