"""What steadying costs a frame: off and paper in turn, in one process, on one thread.

    python benchmarks/overhead.py [--source VIDEO] [--box X,Y,W,H] [--frames N]

Every frame is given to both trackers, in an order that alternates; the figures are medians over
the frames. Needs the folder of test data (see shared_data.py) unless --source is given.
"""

from __future__ import annotations

import argparse
import time
from itertools import islice

import cv2
import numpy as np

import ssiam
from shared_data import VIDEOS, WEIGHTS
from ssiam.video import open_source

METHODS = ("off", "paper")


def timed(tracker: ssiam.SteadiedTracker, frame: np.ndarray) -> float:
    """Milliseconds of one update."""
    start = time.perf_counter()
    tracker.update(frame)
    return 1e3 * (time.perf_counter() - start)


def measure(source: str, box: tuple[float, ...], name: str, count: int) -> dict[str, float]:
    """Median milliseconds a frame of each method, and of the difference of the two."""
    weights = WEIGHTS / name.replace("_", "") if name.startswith("nano") else None
    trackers = [ssiam.load_tracker(name, weights=weights, stabilize=m) for m in METHODS]
    times = []
    with open_source(source) as frames:
        first = next(frames)
        for tracker in trackers:
            tracker.init(first.image, box)
        for frame in islice(frames, count):
            order = (0, 1) if frame.index % 2 else (1, 0)
            took = {i: timed(trackers[i], frame.image) for i in order}
            times.append((took[0], took[1]))
    off, paper = np.array(times[10:]).T
    return {
        "off": float(np.median(off)),
        "paper": float(np.median(paper)),
        "difference": float(np.median(paper - off)),
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--source", default=str(VIDEOS / "shaky-5.avi"))
    parser.add_argument("--box", default="290,95,175,165")
    parser.add_argument("--frames", type=int, default=300)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    box = tuple(float(v) for v in arguments.box.split(","))
    print(
        "| tracker | off, ms | paper, ms | paper - off, ms | paper / off |\n|---|---|---|---|---|"
    )
    for name in ("kcf", "csrt", "nanotrack_v3"):
        if name.startswith("nano") and not WEIGHTS.is_dir():
            continue
        ms = measure(arguments.source, box, name, arguments.frames)
        cells = [f"{value:.2f}" for value in (*ms.values(), ms["paper"] / ms["off"])]
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
