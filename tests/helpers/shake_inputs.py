"""What is shaken in the tests of shakes: clips of one still picture."""

from __future__ import annotations

import cv2
import numpy as np

from ssiam.datasets import VideoSequence

SIZE = (320, 240)
BLOB = (150.3, 108.6)  # where its light is, pixels
STRENGTH = 0.03


def sequence(folder, picture, count, truth, name="clip", **fields):
    """The same picture in every frame."""
    path = folder / f"{name}.png"
    cv2.imwrite(str(path), picture)
    return VideoSequence(name, (path,) * count, np.asarray(truth, dtype=np.float64), **fields)


def blob_picture():
    """A soft light on black: no border's mirror image brings a second one into view."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    light = 250 * np.exp(-((x - BLOB[0]) ** 2 + (y - BLOB[1]) ** 2) / (2 * 3.0**2))
    return np.repeat(np.rint(light).astype(np.uint8)[..., None], 3, axis=2)


def blob_clip(folder, count=12, polygon=False):
    x, y = BLOB
    box = [x - 10, y - 8, 20, 16]
    corners = [x - 10, y - 8, x + 10, y - 8, x + 10, y + 8, x - 10, y + 8]
    return sequence(folder, blob_picture(), count, [corners if polygon else box] * count)
