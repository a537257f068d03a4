"""Accuracy of `Motion.reliable` on known motion, with some frames replaced or blurred.

    python benchmarks/calibration/reliability.py [--frames 60] [--seeds 3]

The drawn scenes of benchmarks/motion/compare.py at 640x360 and 1280x720, with and without the
target's box. Every twelfth frame is replaced by a black one, noise, another scene (a cut) or a dark
one with noise, or is blurred by 8 % of the width. A step is bad, and should be flagged, if the mean
error of the corners is above 1 % of the width, or if it leads to or from a frame without the scene.
Black and dark frames are skipped by the estimator: the step after one is that from the frame
before it.
Needs the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

import ssiam
from ssiam.geometry import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.motion.clips import Clip, corner_distances, drawn_clips

SKIPPED = {"black", "dark"}
REPLACEMENTS = ("black", "noise", "cut", "blur", "dark")
EVERY = 12  # frames from one replacement to the next
FAR = 1.0  # % of the width, error of a bad step


def with_replacements(clip: Clip, seed: int) -> tuple[list[Image], list[str]]:
    """The frames of a clip with some of them replaced, and the kind of each frame."""
    rng = np.random.default_rng(seed)
    frames, kinds = list(clip.frames), ["plain"] * len(clip.frames)
    for number, index in enumerate(range(5, len(frames), EVERY)):
        kinds[index] = REPLACEMENTS[(number + seed) % len(REPLACEMENTS)]
        frames[index] = replacement(kinds[index], frames[index], rng)
    return frames, kinds


def replacement(kind: str, frame: Image, rng: np.random.Generator) -> Image:
    """The replacement of a frame."""
    height, width = frame.shape[:2]
    if kind == "blur":
        side = int(0.08 * width)
        return np.asarray(cv2.blur(frame, (side, side)), np.uint8)
    if kind == "noise":
        return rng.integers(0, 256, frame.shape, np.uint8)
    if kind == "dark":
        return np.clip(rng.normal(6, 2, frame.shape), 0, 255).astype(np.uint8)
    if kind == "cut":
        coarse = rng.integers(0, 256, (height // 20, width // 20, 3), np.uint8)
        scene = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
        return np.asarray(scene, np.uint8)
    return np.zeros_like(frame)


def steps(clip: Clip, seed: int) -> Iterator[tuple[bool, bool]]:
    """For each step, whether it is bad, and whether it is flagged."""
    frames, kinds = with_replacements(clip, seed)
    camera = ssiam.CameraMotion()
    motions = [
        camera.update(frame, exclude=clip.boxes[max(index - 1, 0)] if clip.exclude else None)
        for index, frame in enumerate(frames)
    ]
    height, width = frames[0].shape[:2]
    found = np.stack([motion.cur_from_prev for motion in motions])
    assert clip.cur_from_prev is not None
    true = clip.cur_from_prev.copy()
    for index in range(2, len(frames)):
        if kinds[index - 1] in SKIPPED:
            true[index] = true[index] @ clip.cur_from_prev[index - 1]
    far = corner_distances(found, true, (width, height)) > FAR / 100 * width
    for index in range(1, len(frames)):
        replaced = {kinds[index - 1]} - {"plain", "blur"} - SKIPPED
        replaced |= {kinds[index]} - {"plain", "blur"}
        yield bool(replaced or far[index]), not motions[index].reliable


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    counts: dict[str, list[tuple[bool, bool]]] = defaultdict(list)
    clips = drawn_clips(
        [(640, 360), (1280, 720)], arguments.frames, arguments.seeds, ["easy", "photo", "hard"]
    )
    for number, clip in enumerate(clips):
        group = "with box" if clip.exclude else "without box"
        counts[group].extend(steps(clip, number))
    counts["all"] = [step for group in list(counts.values()) for step in group]
    print("| steps | bad | of them flagged | good | of them flagged |\n|---|---|---|---|---|")
    for name, found in counts.items():
        bad, flagged = np.array(found).T
        print(
            f"| {name} | {bad.sum()} | {100 * flagged[bad].mean():.1f} % "
            f"| {(~bad).sum()} | {100 * flagged[~bad].mean():.1f} % |"
        )


if __name__ == "__main__":
    main()
