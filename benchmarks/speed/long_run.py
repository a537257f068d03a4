"""Time per frame and memory at the beginning and at the end of a long stream; both should be equal.

    python benchmarks/speed/long_run.py [--frames 20000]

Runs camera motion, stabilization and a KCF tracker on a small, endlessly shaking image, and
compares the frames from 100 on with the last ones.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc

import cv2
import numpy as np

import ssiam
from ssiam.geometry import Image, frame_center, rigid

SIZE = (160, 120)
SPAN = 100  # frames of each part that is compared
POSES = 64  # of the camera, repeated


def shaking_frames() -> list[Image]:
    """A frame for each pose."""
    rng = np.random.default_rng(1)
    coarse = rng.integers(0, 256, (30, 40, 3)).astype(np.uint8)
    scene = cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC)
    steps = rng.normal(0, (2, 1.5, 0.005), (POSES, 3))
    return [
        np.asarray(
            cv2.warpAffine(
                scene,
                rigid(dx, dy, angle, frame_center(SIZE))[:2],
                SIZE,
                borderMode=cv2.BORDER_REFLECT_101,
            ),
            np.uint8,
        )
        for dx, dy, angle in steps
    ]


def main() -> None:
    """Print time and memory of both parts, and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000)
    count = parser.parse_args().frames
    cv2.setNumThreads(1)
    frames = shaking_frames()
    tracker = ssiam.load_tracker("kcf")
    tracker.init(frames[0], (60, 40, 40, 40))
    seconds = np.empty(count)
    used = {}
    tracemalloc.start()
    for index in range(count):
        start = time.perf_counter()
        tracker.update(frames[(index + 1) % POSES])
        seconds[index] = time.perf_counter() - start
        if index in (SPAN, count - 1):
            used[index] = tracemalloc.get_traced_memory()[0] / 1024
    early, late = np.median(seconds[SPAN : 2 * SPAN]), np.median(seconds[-SPAN:])
    print(f"frame {SPAN:6d}: {1e3 * early:.3f} ms, {used[SPAN]:.1f} KiB held by Python objects")
    print(f"frame {count:6d}: {1e3 * late:.3f} ms, {used[count - 1]:.1f} KiB")
    print(f"ratio: time {late / early:.2f}, memory {used[count - 1] / used[SPAN]:.3f}")


if __name__ == "__main__":
    main()
