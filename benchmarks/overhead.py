"""What steadying costs a frame, and what of: off, paper and predict in turn, in one process.

    python benchmarks/overhead.py [--source VIDEO] [--box X,Y,W,H] [--frames N]
        [--trackers nanotrack_v3,kcf,csrt] [--sizes 640x360,1280x720]

The first table is of one thread. Every frame is given to all methods, in an order that changes.
The steps of an update (the camera's motion, what to make of it, the tracker on its view) are
timed one by one; what the tracker takes longer than with off is the crop of a view that is not the
raw frame. The second table is of predict with the next frame at hand (`following`), whose motion a
second core estimates meanwhile: off and predict have blocks of frames in turn, without and with it.
All figures are medians over the frames. The video is scaled to each size. Needs the folder of test
data (see shared_data.py) unless --source is given.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from itertools import islice, pairwise

import cv2
import numpy as np

import ssiam
from loading import load
from shared_data import VIDEOS, WEIGHTS
from ssiam.video import open_source

METHODS = ("off", "paper", "predict")
WARM = 10  # frames that are not counted
BLOCK = 20  # frames that a tracker is given in a row
SPILL = 2  # first frames of a block, in which the work of the one before may go on
HEADS = (
    "tracker | size | method | off, ms | method, ms | difference, ms | of off "
    "| motion, ms | prediction, ms | crop, ms",
    "tracker | size | off, ms | predict, ms | of off | predict with following, ms | of off "
    "| same boxes",
)

Box = tuple[float, ...]


class Stepwise:
    """A tracker whose updates are timed step by step."""

    def __init__(self, tracker: ssiam.StabilizedTracker, frame: np.ndarray, box: Box) -> None:
        self._tracker, self._box = tracker, box
        self._camera = tracker.new_camera()
        tracker.init(frame, box)
        if self._camera is not None:
            self._camera.update(frame)

    def update(self, frame: np.ndarray) -> tuple[float, float, float]:
        """Milliseconds of motion, of what is made of it, and of the tracker."""
        start = time.perf_counter()
        motion = None if self._camera is None else self._camera.update(frame, self._box)
        estimated = time.perf_counter()
        step = self._tracker.advance(motion)
        predicted = time.perf_counter()
        track = self._tracker.locate(frame, step)
        looked = time.perf_counter()
        self._box = step.predicted_xywh or track.box
        steps = pairwise((start, estimated, predicted, looked))
        return tuple(1e3 * (end - begin) for begin, end in steps)


def loaded(name: str, method: str) -> ssiam.StabilizedTracker:
    """A tracker on one thread."""
    return load(name, method)


def film(source: str, count: int, box: Box, size: str) -> tuple[list[np.ndarray], Box]:
    """Frames of that size, and the box in the first one."""
    width, height = map(int, size.split("x"))
    with open_source(source) as frames:
        raw = [frame.image for frame in islice(frames, count + 1)]
    x, y = width / raw[0].shape[1], height / raw[0].shape[0]
    scaled = [cv2.resize(image, (width, height)) for image in raw]
    return scaled, tuple(float(v) for v in np.array(box) * (x, y, x, y))


def step_rows(name: str, frames: list[np.ndarray], box: Box) -> list[list[str]]:
    """Cells of the first table, a row for each method but off."""
    trackers = [Stepwise(loaded(name, method), frames[0], box) for method in METHODS]
    times = np.zeros((len(frames), len(METHODS), 3))
    for index, frame in enumerate(frames):
        for turn in range(len(METHODS) if index else 0):
            which = (index + turn) % len(METHODS)
            times[index, which] = trackers[which].update(frame)
    times = times[WARM:]
    off = times[:, 0].sum(axis=1)
    rows = []
    for which, method in enumerate(METHODS[1:], 1):
        took = times[:, which].sum(axis=1)
        crop = times[:, which, 2] - times[:, 0, 2]
        parts = [times[:, which, 0], times[:, which, 1], crop]
        cells = [ms(off), ms(took), ms(took - off), share(took - off, off), *map(ms, parts)]
        rows.append([method, *cells])
    return rows


def ahead_row(name: str, frames: list[np.ndarray], box: Box) -> list[str]:
    """Cells of the second table."""
    trackers = [loaded(name, method) for method in ("off", "predict", "predict")]
    for tracker in trackers:
        tracker.init(frames[0], box)
    steps: list[Callable[..., object]] = [tracker.update for tracker in trackers]
    times = np.full((len(trackers), len(frames)), np.nan)
    boxes = np.zeros((len(trackers), len(frames), 4))
    for first in range(1, len(frames), BLOCK):
        for which, step in enumerate(steps):
            for index in range(first, min(first + BLOCK, len(frames))):
                ahead = frames[index + 1 : index + 2] if which == 2 else []
                start = time.perf_counter()
                track = step(frames[index], following=ahead[0] if ahead else None)
                took = 1e3 * (time.perf_counter() - start)
                boxes[which, index] = track.box
                times[which, index] = took if index >= first + SPILL else np.nan
    off, predict, ahead = times[:, ~np.isnan(times).any(axis=0)]
    same = "yes" if np.array_equal(boxes[1], boxes[2]) else "no"
    costs = [ms(predict), share(predict - off, off), ms(ahead), share(ahead - off, off)]
    return [ms(off), *costs, same]


def ms(values: np.ndarray) -> str:
    """The median."""
    return f"{np.median(values):.2f}"


def share(part: np.ndarray, whole: np.ndarray) -> str:
    """The median of one as a share of that of the other."""
    return f"{100 * np.median(part) / np.median(whole):+.0f} %"


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--source", default=str(VIDEOS / "shaky-5.avi"))
    parser.add_argument("--box", default="290,95,175,165")
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--trackers", default="nanotrack_v3,kcf,csrt", help="names, with commas")
    parser.add_argument("--sizes", default="640x360,1280x720", help="WxH, with commas")
    return parser.parse_args()


def main() -> None:
    """Print the tables."""
    chosen = arguments()
    cv2.setNumThreads(1)
    box = tuple(float(v) for v in chosen.box.split(","))
    names = [n for n in chosen.trackers.split(",") if n[:4] != "nano" or WEIGHTS.is_dir()]
    rows: tuple[list[list[str]], list[list[str]]] = ([], [])
    for size in chosen.sizes.split(","):
        frames, scaled = film(chosen.source, chosen.frames, box, size)
        for name in names:
            rows[0].extend([name, size, *row] for row in step_rows(name, frames, scaled))
            rows[1].append([name, size, *ahead_row(name, frames, scaled)])
    for head, table in zip(HEADS, rows, strict=True):
        print(f"| {head} |\n" + "|---" * (head.count("|") + 1) + "|")
        print(*("| " + " | ".join(row) + " |" for row in table), sep="\n", end="\n\n")


if __name__ == "__main__":
    main()
