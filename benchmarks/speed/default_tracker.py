"""Frames per second of the default tracker, compared with OpenCV's trackers and NanoTrack.

    python benchmarks/speed/default_tracker.py [--rounds 8]

Complete updates on frames of 640x360 pixels, the trackers alone, on one thread and on two, in turn
in one process. Needs the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

import ssiam
from ssiam.geometry import Image
from ssiam.video import open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import VIDEOS
from benchmarks.common.loading import load

TRACKERS = ("lite", "csrt", "kcf", "nanotrack_v1", "nanotrack_v2", "nanotrack_v3")
SIZE = (640, 360)
CLIP, BOX = "shaky-5.avi", (290, 95, 175, 165)  # the red sculpture, pixels of the clip
FRAMES = 25  # of a round
WARM_UP = 5  # frames that do not count
GOALS = {1: 35, 2: 60}  # frames per second, by threads
RATIO_GOAL = 5  # to CSRT


def scaled_clip() -> tuple[list[Image], tuple[float, ...]]:
    """The first frames of the clip at `SIZE`, and the box in the first one."""
    with open_source(VIDEOS / CLIP) as frames:
        width, height = frames.size_wh
        images = [
            np.asarray(cv2.resize(frame.image, SIZE), np.uint8) for frame in islice(frames, FRAMES)
        ]
    box = [v * s for v, s in zip(BOX, (SIZE[0] / width, SIZE[1] / height) * 2, strict=True)]
    return images, tuple(box)


def seconds_per_frame(
    tracker: ssiam.StabilizedTracker, images: list[Image], box: tuple[float, ...]
) -> float:
    """Median seconds per frame of one round."""
    tracker.init(images[0], box)
    times = []
    for image in images[1:]:
        start = time.perf_counter()
        tracker.update(image)
        times.append(time.perf_counter() - start)
    return float(np.median(times[WARM_UP:]))


def main() -> None:
    """Print a table for one thread, and one for two."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--trackers", nargs="+", default=TRACKERS)
    arguments = parser.parse_args()
    names = dict.fromkeys((*arguments.trackers, "csrt"))
    images, box = scaled_clip()
    for threads, goal in GOALS.items():
        cv2.setNumThreads(threads)
        trackers = {name: load(name, "off", threads) for name in names}
        seconds: dict[str, list[float]] = {name: [] for name in names}
        for _ in range(arguments.rounds):
            for name, tracker in trackers.items():
                seconds[name].append(seconds_per_frame(tracker, images, box))
        print(f"\n| {threads} threads | ms | fps | times as fast as CSRT |\n|---|---|---|---|")
        csrt = np.array(seconds["csrt"])
        for name, values in seconds.items():
            own = np.array(values)
            ratio = np.median(csrt / own)
            print(
                f"| {name} | {1e3 * np.median(own):.1f} | {1 / np.median(own):.0f} | {ratio:.1f} |"
            )
        print(f"\ngoals for lite: {goal} frames per second, {RATIO_GOAL} times CSRT")


if __name__ == "__main__":
    main()
