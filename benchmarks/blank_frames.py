"""What trackers do when frames show nothing for a while: 25 gaps of 3-20 frames.

    python benchmarks/blank_frames.py [--trackers lite,nanotrack_v3] [--stabilize predict]
        [--insert] [--verbose]

Black, white, gray, torn and noisy gray frames take the place of frames of the shared sequences and
of the demo clip; with `--insert` they are put in between, and the clip goes on where it was. A
tracker is started on the true box 25 frames before the gap. Wrong: frames after the gap in which
the box is not on the target (IoU < .1) and `lost` is False, though the tracker without a gap is on
the target then. Back: within 30 frames after the gap the target is held again (IoU >= .5, not
lost). `lost` without gaps is counted over the same frames.

The aim: wrong in no gap; back in 20 of 25 for lite and NanoTrack. Needs the folder of test data
(see shared_data.py).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

import ssiam
from shared_data import WEIGHTS, sequences
from ssiam.datasets import Sequence
from ssiam.geometry import iou
from ssiam.trackers import StabilizedTracker
from ssiam.video import open_source

TRACKERS = "lite,nanotrack_v1,nanotrack_v2,nanotrack_v3,csrt,kcf"
DEMO = Path(__file__).parents[1] / "examples" / "shaky-walker.mp4"
BEFORE, AFTER = 25, 30  # frames
ON, ELSEWHERE = 0.5, 0.1  # IoU
HEAD = (
    "tracker",
    "gaps",
    "wrong",
    "wrong for 5 frames",
    "box moved in the gap",
    "back",
    "lost without gaps",
)
KINDS = ("black", "white", "gray", "torn", "noise")
GAPS = (  # clip, first frame, frames
    ("demo", 28, 3),
    ("demo", 30, 5),
    ("demo", 45, 8),
    ("demo", 60, 12),
    ("demo", 70, 20),
    ("Bolt2", 30, 5),
    ("Bolt2", 60, 10),
    ("Bolt2", 120, 3),
    ("Couple", 30, 8),
    ("Couple", 70, 15),
    ("Crossing", 30, 20),
    ("Crossing", 50, 6),
    ("David", 100, 12),
    ("David", 250, 20),
    ("David", 350, 4),
    ("Jumping", 40, 7),
    ("Jumping", 150, 14),
    ("MotorRolling", 30, 3),
    ("MotorRolling", 80, 6),
    ("Skiing", 28, 4),
    ("bag_vot2015", 60, 10),
    ("bag_vot2015", 120, 18),
    ("dtb70_MountainBike6", 30, 9),
    ("uav123_wakeboard7", 27, 5),
    ("uav123_wakeboard7", 30, 8),
)


@dataclass(frozen=True, eq=False)
class Gap:
    """A clip, frame by frame, in which something is blank.

    `shown` are its frames, `plain` those of the clip without a gap (for replaced frames the same
    count), `truth` (N, 4) the boxes of `shown`, `first` and `end` of the gap.
    """

    name: str
    shown: list[np.ndarray]
    plain: list[np.ndarray]
    truth: np.ndarray
    first: int
    end: int


def blank(kind: str, t: int, prev: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """A frame that shows nothing, or half of something."""
    if kind == "black":
        return np.zeros_like(frame)
    if kind == "white":
        return np.full_like(frame, 255)
    if kind == "gray":
        return np.full_like(frame, 128)
    if kind == "noise":
        noise = np.random.default_rng(t).normal(0, 2, frame.shape)
        return (100 + noise).astype(np.uint8)
    torn = frame.copy()  # a decoder that lost most of the frame's slices repeats a line, or gray
    rows = len(frame) // 5 * (t % 3) // 2
    torn[rows:] = frame[rows] if t % 2 else 128
    return torn


def gaps(insert: bool) -> Iterator[Gap]:
    """All of them; the same at every run."""
    real = sequences()
    for number, (clip, first, length) in enumerate(GAPS):
        kind = KINDS[number % len(KINDS)]
        start = max(first - BEFORE, 0)
        stop = first + AFTER + (0 if insert else length)
        frames, truth = _demo() if clip == "demo" else _frames(real[clip], stop)
        plain, boxes = frames[start:stop], truth[start:stop]
        at = first - start
        shown = list(plain)
        if insert:
            shown[at:at] = [blank(kind, t, plain[at - 1], plain[at]) for t in range(length)]
            boxes = np.insert(boxes, [at] * length, boxes[at - 1], axis=0)
        else:
            for t in range(length):
                shown[at + t] = blank(kind, t, plain[at - 1], plain[at + t])
        yield Gap(f"{clip} {first}+{length} {kind}", shown, plain, boxes, at, at + length)


def _demo() -> tuple[list[np.ndarray], np.ndarray]:
    return [f.image for f in open_source(str(DEMO))], np.loadtxt(
        DEMO.with_suffix(".txt"), delimiter=","
    )


def _frames(sequence: Sequence, stop: int) -> tuple[list[np.ndarray], np.ndarray]:
    frames = [f for f, _ in zip(sequence.images(), range(stop), strict=False)]
    return frames, np.array([sequence.box(index) for index in range(len(frames))])


def followed(
    tracker: StabilizedTracker, frames: list[np.ndarray], first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Boxes (N, 4) and `lost` (N,) of all frames."""
    tracker.init(frames[0], first.tolist())
    tracks = [tracker.update(frame) for frame in frames[1:]]
    boxes = np.array([first, *(track.box for track in tracks)])
    lost = np.array([False, *(track.lost for track in tracks)])
    return boxes, lost


def main() -> None:
    """Print a line for every tracker."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trackers", default=TRACKERS, help="names, with commas")
    parser.add_argument("--stabilize", default="predict", help="one method")
    parser.add_argument("--insert", action="store_true", help="between frames, not in their place")
    parser.add_argument("--only", default="", help="gaps whose name has this in it")
    parser.add_argument("--verbose", action="store_true", help="a line for every gap")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    cases = [gap for gap in gaps(chosen.insert) if chosen.only in gap.name]
    print("| " + " | ".join(HEAD) + " |")
    print("|---" * len(HEAD) + "|")
    for name in chosen.trackers.split(","):
        weights = WEIGHTS / name.replace("_", "") if name.startswith("nano") else None
        tracker = ssiam.load_tracker(name, weights=weights, stabilize=chosen.stabilize)
        wrong, long, moved, back, lost_plain, count_plain = 0, 0, 0, 0, 0, 0
        for gap in cases:
            boxes, lost = followed(tracker.clone(), gap.shown, gap.truth[0])
            plain_boxes, plain_lost = followed(tracker.clone(), gap.plain, gap.truth[0])
            lost_plain, count_plain = lost_plain + plain_lost.sum(), count_plain + len(plain_lost)
            overlap = iou(boxes, gap.truth)
            length = gap.end - gap.first
            other = np.insert(plain_boxes, [gap.first] * length, plain_boxes[gap.first - 1], axis=0)
            on = iou(other if chosen.insert else plain_boxes, gap.truth) >= ON
            off = (overlap < ELSEWHERE) & ~lost & on
            held = (overlap >= ON) & ~lost
            run = int(off[gap.end :].sum())
            away = np.abs(boxes[gap.first : gap.end] - boxes[gap.first - 1]).max()
            wrong, long, moved = wrong + (run > 0), long + (run >= 5), moved + (away > 1)
            back += bool(held[gap.end : gap.end + AFTER].any())
            if chosen.verbose:
                after = int(held[gap.end :].argmax()) if held[gap.end :].any() else "never"
                print(
                    f"{name} {gap.name}: moved {away:.0f}, wrong {run} (without a gap on the "
                    f"target in {on[gap.end :].sum()} of {on[gap.end :].size}), back after {after}",
                    flush=True,
                )
        print(
            f"| {name} | {len(cases)} | {wrong} | {long} | {moved} | {back} "
            f"| {lost_plain} of {count_plain} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
