"""Time of a frame while the target is tracked, and while it is lost and searched for everywhere.

    python benchmarks/speed/lost.py [--rounds 5] [--frames 40]

Frames of 640x360 pixels of a shaking clip, one thread. Three trackers take turns, frame by frame:
one whose target is visible, the same without what is remembered for the search, and one whose
target has been covered for so long that it is searched for. Prints medians of the rounds' mean
processor times, and their ratios to the second one. Needs the folder of test data (see
benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import cv2
import numpy as np

from ssiam.geometry import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.loading import load
from benchmarks.speed.default_tracker import scaled_clip
from ssiam.trackers import StabilizedTracker

WARM_UP = 45  # frames until a covered target is searched for


def without_memory(tracker: StabilizedTracker) -> None:
    """Leave out what is remembered of a tracked target for a later search."""
    follower = tracker._target.follower  # type: ignore[union-attr]
    follower._observe = lambda view, track: None  # type: ignore[union-attr]


def covered(frame: Image, box: tuple[float, ...]) -> Image:
    """The frame with a gray rectangle over the whole scene around the target."""
    hidden = frame.copy()
    x, y, w, h = (int(each) for each in box)
    hidden[max(y - h, 0) : y + 2 * h, max(x - w, 0) : x + 2 * w] = (90, 110, 100)
    return hidden


def main() -> None:
    """Print the ratios."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--frames", type=int, default=40, help="of a round")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    frames, box = scaled_clip()
    names = "tracked", "tracked, nothing remembered", "lost"
    trackers = {name: load("lite") for name in names}
    for tracker in trackers.values():
        tracker.init(frames[0], box)
    without_memory(trackers[names[1]])
    order = [*range(1, len(frames)), *range(len(frames) - 2, 0, -1)]
    means: dict[str, list[float]] = {name: [] for name in names}
    index = 0
    for number in range(chosen.rounds + 1):
        spent = dict.fromkeys(names, 0.0)
        for _ in range(chosen.frames if number else WARM_UP):
            frame = frames[order[index % len(order)]]
            index += 1
            for name, tracker in trackers.items():
                image = covered(frame, box) if name == "lost" else frame
                start = time.process_time()
                track = tracker.update(image)
                spent[name] += time.process_time() - start
                assert number == 0 or track.lost == (name == "lost"), name
        for name in names if number else ():
            means[name].append(spent[name] / chosen.frames)
    base = np.array(means[names[1]])
    for name in names:
        ratio = float(np.median(np.array(means[name]) / base))
        print(f"{name}: {1000 * float(np.median(means[name])):.1f} ms, ratio {ratio:.3f}")


if __name__ == "__main__":
    main()
