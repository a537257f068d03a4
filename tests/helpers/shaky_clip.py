"""A shaking clip of a patch that moves over a synthetic background, with its true boxes."""

import cv2
import numpy as np

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam.geometry import map_box
from ssiam.video import VideoSink

SIZE = (320, 240)
PATCH = (40, 36)  # width, height


def shaky_frames(count, *, seed=3, start=(60, 90), step=(1.2, 0.3), hidden=range(0)):
    """Frames (240, 320, 3) and the patch's boxes; the patch is hidden in the frames `hidden`."""
    r = generator(seed)
    background = world(seed, SIZE)
    patch = cv2.resize(r.integers(0, 256, (6, 7, 3), np.uint8), PATCH)
    frames, boxes = [], []
    for index, pose in enumerate(poses(r.normal(0, (4, 4, 0.01), (count, 3)), SIZE)):
        x, y = (round(s + index * d) for s, d in zip(start, step, strict=True))
        scene = background.copy()
        if index not in hidden:
            scene[y : y + PATCH[1], x : x + PATCH[0]] = patch
        frames.append(camera_frame(scene, pose))
        boxes.append(map_box(pose, (x, y, *PATCH)))
    return frames, boxes


def write_clip(path, count=90, fps=30, **options):
    """Write the clip; returns the patch's box in every frame."""
    frames, boxes = shaky_frames(count, **options)
    with VideoSink(path, fps) as sink:
        for frame in frames:
            sink.write(frame)
    return boxes
