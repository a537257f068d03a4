"""Is `Motion.reliable` honest? Motion that is known, with frames among it that tell nothing.

    python benchmarks/calibration/reliability.py [--frames 60] [--seeds 3]

The drawn scenes of benchmarks/motion/compare.py, at 640x360 and 1280x720, with the target's box told and
not told. Every twelfth frame is replaced by a black one, noise, another scene (a cut), a dark one
with noise, or is blurred by 8 % of the width. A step is bad if the mean error of the corners is
beyond 1 % of the width, or if it leads to or from a frame that shows nothing of the scene; it
should be flagged. Needs the folder of test data (see shared_data.py).
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

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.motion.clips import Clip, corner_distances, drawn_clips

ODD = ("black", "noise", "cut", "blur", "dark")
EVERY = 12
FAR = 1.0  # % of the width


def with_odd_frames(clip: Clip, seed: int) -> tuple[list[np.ndarray], list[str]]:
    """The clip's frames, some of them replaced, and what each of them is."""
    rng = np.random.default_rng(seed)
    frames, kinds = list(clip.frames), ["plain"] * len(clip.frames)
    for number, index in enumerate(range(5, len(frames), EVERY)):
        kinds[index] = ODD[(number + seed) % len(ODD)]
        frames[index] = odd_frame(kinds[index], frames[index], rng)
    return frames, kinds


def odd_frame(kind: str, frame: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What stands in for a frame."""
    height, width = frame.shape[:2]
    if kind == "blur":
        return cv2.blur(frame, (int(0.08 * width),) * 2)
    if kind == "noise":
        return rng.integers(0, 256, frame.shape, np.uint8)
    if kind == "dark":
        return np.clip(rng.normal(6, 2, frame.shape), 0, 255).astype(np.uint8)
    if kind == "cut":
        coarse = rng.integers(0, 256, (height // 20, width // 20, 3), np.uint8)
        return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.zeros_like(frame)


def steps(clip: Clip, seed: int) -> Iterator[tuple[bool, bool]]:
    """Whether each step is bad, and whether it is flagged."""
    frames, kinds = with_odd_frames(clip, seed)
    camera = ssiam.CameraMotion()
    motions = [
        camera.update(frame, exclude=clip.boxes[max(index - 1, 0)] if clip.exclude else None)
        for index, frame in enumerate(frames)
    ]
    height, width = frames[0].shape[:2]
    found = np.stack([motion.cur_from_prev for motion in motions])
    far = corner_distances(found, clip.cur_from_prev, (width, height)) > FAR / 100 * width
    for index in range(1, len(frames)):
        senseless = {kinds[index - 1], kinds[index]} - {"plain", "blur"}
        yield bool(senseless or far[index]), not motions[index].reliable


def main() -> None:
    """Print the shares."""
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
        told = "box told" if clip.exclude else "no box"
        counts[told].extend(steps(clip, number))
    counts["all"] = [step for told in list(counts.values()) for step in told]
    print("| steps | bad | of them flagged | good | of them flagged |\n|---|---|---|---|---|")
    for name, found in counts.items():
        bad, flagged = np.array(found).T
        print(
            f"| {name} | {bad.sum()} | {100 * flagged[bad].mean():.1f} % "
            f"| {(~bad).sum()} | {100 * flagged[~bad].mean():.1f} % |"
        )


if __name__ == "__main__":
    main()
