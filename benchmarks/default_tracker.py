"""Frames a second of the default tracker, beside OpenCV's and NanoTrack.

    python benchmarks/default_tracker.py [--rounds 8]

Whole frames of 640x360 pixels (crop, network, mask, choice), the tracker alone, on one thread and
on two, every tracker in turn in one process. Needs the folder of test data (see shared_data.py).
"""

from __future__ import annotations

import argparse
import time
from itertools import islice

import cv2
import numpy as np

import ssiam
from loading import load
from shared_data import VIDEOS
from ssiam.video import open_source

TRACKERS = ("lite", "csrt", "kcf", "nanotrack_v1", "nanotrack_v2", "nanotrack_v3")
SIZE = (640, 360)
CLIP, BOX = "shaky-5.avi", (290, 95, 175, 165)  # the red sculpture, in its own pixels
FRAMES = 25  # of a turn; the first few are not counted
WARM = 5
LIMITS = {1: 35, 2: 60}  # frames a second, by threads
RATIO = 5  # to CSRT


def pictures() -> tuple[list[np.ndarray], tuple[float, ...]]:
    """Frames of the clip, and the box in the first one."""
    with open_source(VIDEOS / CLIP) as frames:
        width, height = frames.size_wh
        images = [cv2.resize(frame.image, SIZE) for frame in islice(frames, FRAMES)]
    box = [v * s for v, s in zip(BOX, (SIZE[0] / width, SIZE[1] / height) * 2, strict=True)]
    return images, tuple(box)


def loaded(name: str, threads: int) -> ssiam.StabilizedTracker:
    """The tracker alone."""
    return load(name, "off", threads)


def turn(
    tracker: ssiam.StabilizedTracker, images: list[np.ndarray], box: tuple[float, ...]
) -> float:
    """Median seconds of a frame."""
    tracker.init(images[0], box)
    times = []
    for image in images[1:]:
        begun = time.perf_counter()
        tracker.update(image)
        times.append(time.perf_counter() - begun)
    return float(np.median(times[WARM:]))


def main() -> None:
    """Print a table for one thread and one for two."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--trackers", nargs="+", default=TRACKERS)
    chosen = parser.parse_args()
    rounds = chosen.rounds
    names = dict.fromkeys((*chosen.trackers, "csrt"))
    images, box = pictures()
    for threads, limit in LIMITS.items():
        cv2.setNumThreads(threads)
        trackers = {name: loaded(name, threads) for name in names}
        seconds = {name: [] for name in names}
        for _ in range(rounds):
            for name, tracker in trackers.items():
                seconds[name].append(turn(tracker, images, box))
        print(f"\n| {threads} threads | ms | fps | times as fast as CSRT |\n|---|---|---|---|")
        csrt = np.array(seconds["csrt"])
        for name, own in seconds.items():
            ratio = np.median(csrt / own)
            print(
                f"| {name} | {1e3 * np.median(own):.1f} | {1 / np.median(own):.0f} | {ratio:.1f} |"
            )
        print(f"\nlimits for lite: {limit} frames a second, {RATIO} times CSRT")


if __name__ == "__main__":
    main()
