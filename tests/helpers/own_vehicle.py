"""A strongly textured hood that moves with the camera, over a pale scene."""

import numpy as np

from helpers.synthetic import camera_frame, generator, poses, world

SIZE = (640, 360)
SHIFT = 9.0  # px, of the scene from frame to frame
HOOD_XYWH = (40, 150, 560, 210)
HOOD = np.zeros((360, 640), bool)
HOOD[150:, 40:600] = True


def frames(count=3):
    """The hood covers half of each frame; the scene moves by `SHIFT` to the right and back."""
    scene = world(3, SIZE)
    hood = np.kron(generator(2).integers(0, 256, (45, 80, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    moved = poses([(SHIFT * (index % 2), 0, 0) for index in range(count)], SIZE)
    pale = [camera_frame(scene, pose) // 4 + 90 for pose in moved]
    return [np.where(HOOD[..., None], hood, frame).astype(np.uint8) for frame in pale]
