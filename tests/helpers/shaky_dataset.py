"""A dataset of small clips with a shaking camera, written to disk in OTB's layout."""

import cv2
import numpy as np

from helpers.synthetic import camera_frame, generator, poses, world

SIZE = (160, 120)  # width, height
TARGET = (28, 22)  # width, height


def write_dataset(folder, sequences=3, frames=24):
    """Clips of a patch that moves over a shaking background and jumps once, halfway."""
    for number in range(sequences):
        write_sequence(folder / f"clip{number}", number, frames)
    return folder


def write_sequence(folder, seed, frames):
    images = folder / "img"
    images.mkdir(parents=True)
    r = generator(seed)
    background = world(seed, SIZE)
    patch = r.integers(0, 256, (11, 14, 3), np.uint8)
    patch = cv2.resize(patch, TARGET, interpolation=cv2.INTER_NEAREST)
    path = poses(r.normal(0, (2, 2, 0.01), (frames, 3)), SIZE)
    lines = []
    for index, pose in enumerate(path):
        x, y = 20 + 2 * index, 40 + index
        if index == frames // 2:
            x, y = 100, 5  # a jump that most trackers do not survive
        frame = camera_frame(background, pose)
        frame[y : y + TARGET[1], x : x + TARGET[0]] = patch
        cv2.imwrite(str(images / f"{index + 1:04d}.jpg"), frame)
        lines.append(f"{x + 1},{y + 1},{TARGET[0]},{TARGET[1]}\n")
    (folder / "groundtruth_rect.txt").write_text("".join(lines))
