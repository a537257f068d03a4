"""Synthetic images and videos with known content and motion."""

import cv2
import numpy as np

from ssiam.geometry import frame_center, rigid


def generator(seed):
    """A random generator that gives the same numbers in every NumPy version."""
    return np.random.Generator(np.random.PCG64(seed))


def golden_video(name, count=16):
    """Frames (240, 320, 3) of the reference videos "A" and "B", and the first box."""
    r = generator(77)
    blocks = r.integers(40, 216, (15, 20, 3))
    texture = r.integers(-12, 13, (300, 400, 3))
    canvas = np.clip(np.kron(blocks, np.ones((20, 20, 1))) + texture, 0, 255).astype(np.uint8)
    target = np.kron(r.integers(0, 256, (8, 6, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    offsets = r.integers(-6, 7, (count, 2))
    offsets[0] = 0
    v, u = np.mgrid[0:64, 0:48]
    ellipse = ((u - 23.5) / 24) ** 2 + ((v - 31.5) / 32) ** 2 <= 1
    frames = []
    for t, (ox, oy) in enumerate(offsets):
        frame = canvas[30 + oy : 270 + oy, 40 + ox : 360 + ox].copy()
        left, top = (60 + 6 * t, 90 + 2 * t) if name == "A" else (-10 + 3 * t, -12 + 2 * t)
        rows, columns = v[ellipse] + top - oy, u[ellipse] + left - ox
        inside = (rows >= 0) & (rows < 240) & (columns >= 0) & (columns < 320)
        frame[rows[inside], columns[inside]] = target[ellipse][inside]
        frames.append(frame)
    return frames, (60, 90, 48, 64) if name == "A" else (0, 0, 38, 52)


def world(seed=0, size_wh=(640, 360)):
    """A richly textured image with rectangles and discs, (H, W, 3) uint8."""
    r = generator(seed)
    width, height = size_wh
    image = np.full((height, width, 3), 120.0)
    for cell in (64, 24, 10, 5):
        coarse = r.normal(0, 22, (height // cell + 2, width // cell + 2, 3)).astype(np.float32)
        image += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    for _ in range(width * height // 900):
        x, y = (int(v) for v in r.integers(0, (width, height)))
        size = int(r.integers(4, 26))
        color = [float(v) for v in r.uniform(20, 235, 3)]
        if r.random() < 0.5:
            cv2.rectangle(image, (x, y), (x + size, y + size), color, -1)
        else:
            cv2.circle(image, (x, y), size // 2, color, -1)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.8), 0, 255).astype(np.uint8)


def camera_frame(scene, frame_from_world):
    """The frame of a camera before a scene image of its size, mirrored at the borders."""
    height, width = scene.shape[:2]
    return cv2.warpAffine(
        scene, frame_from_world[:2], (width, height), borderMode=cv2.BORDER_REFLECT_101
    )


def poses(shifts_angles, size_wh):
    """frame_from_world of a camera at each (dx, dy, angle), rotated about the frame center."""
    return [rigid(dx, dy, angle, frame_center(size_wh)) for dx, dy, angle in shifts_angles]
