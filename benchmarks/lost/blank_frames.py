"""Trackers on clips with blank frames: 25 gaps of 3-20 frames.

    python benchmarks/lost/blank_frames.py [--trackers lite,nanotrack_v3] [--stabilize predict]
        [--insert] [--verbose]

Black, white, gray, torn and noisy gray frames replace frames of the shared sequences and of the
demo clip; with `--insert` they are inserted between frames. A tracker is started on the true box 25
frames before the gap. "Wrong" counts gaps followed by frames in which the box is not on the target
(IoU < .1) and `lost` is False, although the tracker without a gap is on the target there. "Back"
counts gaps after which the target is tracked within 30 frames (IoU >= .5, not lost). "Lost without
gaps" is counted over the same frames.

The goals: no wrong gap; back in 20 of 25 for lite and NanoTrack. Needs the folder of test data (see
benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import VideoSequence
from ssiam.geometry import Image, iou
from ssiam.trackers import StabilizedTracker
from ssiam.video import open_source

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import EXAMPLES, sequences
from benchmarks.common.loading import load
from benchmarks.common.tables import head

TRACKERS = "lite,nanotrack_v1,nanotrack_v2,nanotrack_v3,csrt,kcf"
DEMO = EXAMPLES / "shaky-walker.mp4"

Floats = NDArray[np.float64]

BEFORE, AFTER = 25, 30  # frames before and after the gap
TRACKED, MISSED = 0.5, 0.1  # IoU of a tracked and of a missed target
LONG = 5  # wrong frames that are counted separately
HEAD = (
    "tracker",
    "gaps",
    "wrong",
    f"wrong for {LONG} frames",
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
    """A clip with blank frames.

    Attributes
    ----------
    name : str
    frames, without_gap : list of (H, W, 3) uint8 BGR
        The frames with the gap, and those without it: as many if the blank frames replace others.
    truth : (N, 4) float64
        True boxes of `frames`, x, y, w, h in pixels.
    first, end : int
        First blank frame, and the frame after the last one.
    """

    name: str
    frames: list[Image]
    without_gap: list[Image]
    truth: Floats
    first: int
    end: int


def blank(kind: str, t: int, frame: Image) -> Image:
    """A blank frame, or one that is blank in its lower part."""
    if kind == "black":
        return np.zeros_like(frame)
    if kind == "white":
        return np.full_like(frame, 255)
    if kind == "gray":
        return np.full_like(frame, 128)
    if kind == "noise":
        noise = np.random.default_rng(t).normal(0, 2, frame.shape)
        return (100 + noise).astype(np.uint8)
    torn = frame.copy()  # decoders fill lost slices of a frame with a repeated line, or gray
    rows = len(frame) // 5 * (t % 3) // 2
    torn[rows:] = frame[rows] if t % 2 else 128
    return torn


def gaps(insert: bool) -> Iterator[Gap]:
    """All gaps; the same in every run."""
    real = sequences()
    for number, (clip, first, length) in enumerate(GAPS):
        kind = KINDS[number % len(KINDS)]
        start = max(first - BEFORE, 0)
        stop = first + AFTER + (0 if insert else length)
        frames, truth = _demo() if clip == "demo" else _frames(real[clip], stop)
        plain, boxes = frames[start:stop], truth[start:stop]
        at = first - start
        gapped = list(plain)
        if insert:
            gapped[at:at] = [blank(kind, t, plain[at]) for t in range(length)]
            boxes = np.insert(boxes, [at] * length, boxes[at - 1], axis=0)
        else:
            for t in range(length):
                gapped[at + t] = blank(kind, t, plain[at + t])
        yield Gap(f"{clip} {first}+{length} {kind}", gapped, plain, boxes, at, at + length)


def _demo() -> tuple[list[Image], Floats]:
    frames = [frame.image for frame in open_source(str(DEMO))]
    return frames, np.loadtxt(DEMO.with_suffix(".txt"), delimiter=",")


def _frames(sequence: VideoSequence, stop: int) -> tuple[list[Image], Floats]:
    frames = [f for f, _ in zip(sequence.images(), range(stop), strict=False)]
    return frames, np.array([sequence.box(index) for index in range(len(frames))])


def tracked(
    tracker: StabilizedTracker, frames: list[Image], first: Floats
) -> tuple[Floats, NDArray[np.bool_]]:
    """Boxes (N, 4) and `lost` (N,) of all frames."""
    tracker.init(frames[0], first.tolist())
    tracks = [tracker.update(frame) for frame in frames[1:]]
    boxes = np.array([first, *(track.box for track in tracks)])
    lost = np.array([False, *(track.lost for track in tracks)])
    return boxes, lost


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trackers", default=TRACKERS, help="names, comma-separated")
    parser.add_argument("--stabilize", default="predict", help="method")
    parser.add_argument("--insert", action="store_true", help="insert the blank frames")
    parser.add_argument("--only", default="", help="gaps whose name contains this")
    parser.add_argument("--verbose", action="store_true", help="print a line for every gap")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    cases = [gap for gap in gaps(arguments.insert) if arguments.only in gap.name]
    print(head(HEAD))
    for name in arguments.trackers.split(","):
        tracker = load(name, arguments.stabilize)
        wrong, long, moved, back, lost_without, frames_without = 0, 0, 0, 0, 0, 0
        for gap in cases:
            boxes, lost = tracked(tracker.clone(), gap.frames, gap.truth[0])
            plain_boxes, plain_lost = tracked(tracker.clone(), gap.without_gap, gap.truth[0])
            lost_without += int(plain_lost.sum())
            frames_without += len(plain_lost)
            overlap = iou(boxes, gap.truth)
            if arguments.insert:
                gap_frames = [gap.first] * (gap.end - gap.first)
                plain_boxes = np.insert(plain_boxes, gap_frames, plain_boxes[gap.first - 1], axis=0)
            expected = iou(plain_boxes, gap.truth) >= TRACKED
            is_wrong = (overlap < MISSED) & ~lost & expected
            is_tracked = (overlap >= TRACKED) & ~lost
            count = int(is_wrong[gap.end :].sum())
            shift = float(np.abs(boxes[gap.first : gap.end] - boxes[gap.first - 1]).max())
            wrong, long, moved = wrong + (count > 0), long + (count >= LONG), moved + (shift > 1)
            back += bool(is_tracked[gap.end : gap.end + AFTER].any())
            if arguments.verbose:
                rest = is_tracked[gap.end :]
                after = int(rest.argmax()) if rest.any() else "never"
                print(
                    f"{name} {gap.name}: moved {shift:.0f}, wrong {count} (without a gap on the "
                    f"target in {expected[gap.end :].sum()} of {expected[gap.end :].size}), "
                    f"back after {after}",
                    flush=True,
                )
        print(
            f"| {name} | {len(cases)} | {wrong} | {long} | {moved} | {back} "
            f"| {lost_without} of {frames_without} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
