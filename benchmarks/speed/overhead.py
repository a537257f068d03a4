"""Time that stabilization adds to each frame, by step: off, paper and predict in one process.

    python benchmarks/speed/overhead.py [--source VIDEO] [--box X,Y,W,H] [--frames N] [--rounds N]
        [--trackers nanotrack_v3,kcf,csrt] [--sizes 640x360,1280x720]

The first table is for one thread. All methods process every frame, in a changing order. The steps
of an update (camera motion, prediction, the tracker on its view) are timed separately; the extra
time of the tracker compared with off is the crop from a stabilized view. The second table is for
predict with the next frame given (`following`): a second core estimates its motion in advance. Off
and predict process blocks of frames in turn, without and with it. The network has one thread in
both, so that off leaves the second core idle. All figures are medians over the frames of the least
times in several rounds. The last columns are the CPU time of the calling thread: where other
processes use all CPUs, the scheduler puts the second thread on the CPU of the first one, and what
it does is not hidden. The video is scaled to each size. Needs the folder of test data (see
benchmarks/common/data.py) unless --source is given.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.geometry import Image
from ssiam.video import open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import VIDEOS, WEIGHTS
from benchmarks.common.loading import load

METHODS = ("off", "paper", "predict")
WARM_UP = 10  # frames that do not count
BLOCK = 20  # consecutive frames of one tracker
SKIPPED = 2  # first frames of a block, which may overlap with work of the previous one
HEADS = (
    "tracker | size | method | off, ms | method, ms | difference, ms | of off "
    "| motion, ms | prediction, ms | crop, ms",
    "tracker | size | off, ms | predict, ms | of off | predict with following, ms | of off "
    "| off, CPU ms | with following, CPU ms | of off | same boxes",
)

Box = tuple[float, ...]
Floats = NDArray[np.float64]


class Stepwise:
    """A tracker whose updates are timed by step."""

    def __init__(self, tracker: ssiam.StabilizedTracker, frame: Image, box: Box) -> None:
        self._tracker, self._box = tracker, box
        self._camera = tracker.new_camera()
        tracker.init(frame, box)
        if self._camera is not None:
            self._camera.update(frame)

    def update(self, frame: Image) -> tuple[float, float, float]:
        """Milliseconds of camera motion, prediction and tracker."""
        start = time.perf_counter()
        motion = None if self._camera is None else self._camera.update(frame, self._box)
        estimated = time.perf_counter()
        step = self._tracker.advance(motion)
        predicted = time.perf_counter()
        track = self._tracker.locate(frame, step)
        tracked = time.perf_counter()
        self._box = step.predicted_xywh or track.box
        return (
            1e3 * (estimated - start),
            1e3 * (predicted - estimated),
            1e3 * (tracked - predicted),
        )


def scaled_video(source: str, count: int, box: Box, size: str) -> tuple[list[Image], Box]:
    """Frames of the given size, and the box in the first one."""
    width, height = map(int, size.split("x"))
    with open_source(source) as frames:
        raw = [frame.image for frame in islice(frames, count + 1)]
    x, y = width / raw[0].shape[1], height / raw[0].shape[0]
    scaled = [np.asarray(cv2.resize(image, (width, height)), np.uint8) for image in raw]
    return scaled, tuple(float(v) for v in np.array(box) * (x, y, x, y))


def step_rows(name: str, frames: list[Image], box: Box, rounds: int) -> list[list[str]]:
    """Rows of the first table, for each method but off."""
    loaded = [load(name, method) for method in METHODS]
    times = np.full((len(frames), len(METHODS), 3), np.inf)
    for _ in range(rounds):
        trackers = [Stepwise(each.clone(), frames[0], box) for each in loaded]
        for index, frame in enumerate(frames):
            for turn in range(len(METHODS) if index else 0):
                which = (index + turn) % len(METHODS)
                taken = trackers[which].update(frame)
                times[index, which] = np.minimum(times[index, which], taken)
    times = times[WARM_UP:]
    off = times[:, 0].sum(axis=1)
    rows = []
    for which, method in enumerate(METHODS[1:], 1):
        total = times[:, which].sum(axis=1)
        crop = times[:, which, 2] - times[:, 0, 2]
        parts = [times[:, which, 0], times[:, which, 1], crop]
        cells = [ms(off), ms(total), ms(total - off), share(total - off, off), *map(ms, parts)]
        rows.append([method, *cells])
    return rows


def following_row(name: str, frames: list[Image], box: Box, rounds: int) -> list[str]:
    """A row of the second table."""
    trackers = [load(name, method) for method in ("off", "predict", "predict")]
    times = np.full((2, len(trackers), len(frames)), np.inf)  # wall, CPU
    boxes = np.zeros((len(trackers), len(frames), 4))
    for _ in range(rounds):
        for tracker in trackers:
            tracker.init(frames[0], box)
        for first in range(1, len(frames), BLOCK):
            for which, tracker in enumerate(trackers):
                for index in range(first, min(first + BLOCK, len(frames))):
                    following = (
                        frames[index + 1] if which == 2 and index + 1 < len(frames) else None
                    )
                    start, start_cpu = time.perf_counter(), time.thread_time()
                    track = tracker.update(frames[index], following=following)
                    taken = time.perf_counter() - start, time.thread_time() - start_cpu
                    boxes[which, index] = track.box
                    if index >= first + SKIPPED:
                        least = np.minimum(times[:, which, index], np.multiply(taken, 1e3))
                        times[:, which, index] = least
    wall, cpu = times[:, :, np.isfinite(times).all(axis=(0, 1))]
    off, predict, with_following = wall
    same = "yes" if np.array_equal(boxes[1], boxes[2]) else "no"
    costs = [
        ms(predict),
        share(predict - off, off),
        ms(with_following),
        share(with_following - off, off),
        ms(cpu[0]),
        ms(cpu[2]),
        share(cpu[2] - cpu[0], cpu[0]),
    ]
    return [ms(off), *costs, same]


def ms(values: Floats) -> str:
    """The median, milliseconds."""
    return f"{np.median(values):.2f}"


def share(part: Floats, whole: Floats) -> str:
    """Ratio of the medians."""
    return f"{100 * np.median(part) / np.median(whole):+.0f} %"


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--source", default=str(VIDEOS / "shaky-5.avi"))
    parser.add_argument("--box", default="290,95,175,165")
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument(
        "--trackers", default="nanotrack_v3,kcf,csrt", help="names, comma-separated"
    )
    parser.add_argument("--sizes", default="640x360,1280x720", help="WxH, comma-separated")
    return parser.parse_args()


def main() -> None:
    """Print the tables."""
    chosen = parsed_arguments()
    cv2.setNumThreads(1)
    box = tuple(float(v) for v in chosen.box.split(","))
    names = [n for n in chosen.trackers.split(",") if n[:4] != "nano" or WEIGHTS.is_dir()]
    rows: tuple[list[list[str]], list[list[str]]] = ([], [])
    for size in chosen.sizes.split(","):
        frames, scaled = scaled_video(chosen.source, chosen.frames, box, size)
        for name in names:
            rows[0].extend(
                [name, size, *row] for row in step_rows(name, frames, scaled, chosen.rounds)
            )
            rows[1].append([name, size, *following_row(name, frames, scaled, chosen.rounds)])
    for head, table in zip(HEADS, rows, strict=True):
        print(f"| {head} |\n" + "|---" * (head.count("|") + 1) + "|")
        print(*("| " + " | ".join(row) + " |" for row in table), sep="\n", end="\n\n")


if __name__ == "__main__":
    main()
