"""Clips of one still image, to which the tests of shake add camera motion."""

from __future__ import annotations

import cv2
import numpy as np

from ssiam.datasets import VideoSequence

SIZE = (320, 240)
BLOB = (150.3, 108.6)  # center of the blob, pixels
STRENGTH = 0.03


def sequence(folder, image, count, truth, name="clip", **fields):
    """A sequence with the same image in every frame."""
    path = folder / f"{name}.png"
    cv2.imwrite(str(path), image)
    return VideoSequence(name, (path,) * count, np.asarray(truth, dtype=np.float64), **fields)


def blob_image():
    """A blurred white blob on black, too far from the borders to be visible in their reflection."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    intensity = 250 * np.exp(-((x - BLOB[0]) ** 2 + (y - BLOB[1]) ** 2) / (2 * 3.0**2))
    return np.repeat(np.rint(intensity).astype(np.uint8)[..., None], 3, axis=2)


def blob_clip(folder, count=12, polygon=False):
    x, y = BLOB
    box = [x - 10, y - 8, 20, 16]
    corners = [x - 10, y - 8, x + 10, y - 8, x + 10, y + 8, x - 10, y + 8]
    return sequence(folder, blob_image(), count, [corners if polygon else box] * count)
