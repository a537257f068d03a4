"""Camera motion on real footage that is shaken with known motion.

    python benchmarks/motion.py [--keypoints grid,orb] [--frames 60]

Every sequence is shaken by shifts of 2, 3 and 5 % of the width with 1 degree of roll, independent
from frame to frame, and by a hand-held path (1/f). What the estimator says of a shaken pair must be
what it says of the unshaken pair with the known shake applied: the mean distance of the corners
between the two, in % of the width, is the error. Needs the folder of test data (see
shared_data.py).
"""

from __future__ import annotations

import argparse
import time
from itertools import islice
from typing import get_args

import cv2
import numpy as np

import ssiam
from shared_data import SEQUENCES, read_sequence
from ssiam.geometry import corners_from_xywh, frame_centre, map_box, map_points, rigid
from ssiam.motion import KeypointName
from ssiam.video import open_source

SHAKES = ("2 %", "3 %", "5 %", "hand-held")
FAR = 1.0  # % of the width, beyond which an estimate is useless


def hand_held(count: int, rng: np.random.Generator) -> np.ndarray:
    """Path (count, 3) with a 1/f amplitude and standard deviation 1 in each column."""
    frequency = np.fft.rfftfreq(count)[:, None]
    amplitude = np.divide(1, frequency, out=np.zeros_like(frequency), where=frequency > 0)
    phase = np.exp(2j * np.pi * rng.random((len(frequency), 3)))
    path = np.fft.irfft(amplitude * phase, count, axis=0)
    return path / path.std(axis=0)


def poses(shake: str, count: int, size_wh: tuple[int, int], name: str) -> list[np.ndarray]:
    """shaken_from_raw of every frame; the same at every run."""
    rng = np.random.default_rng(sum(map(ord, name + shake)))
    width = size_wh[0]
    if shake == "hand-held":
        steps = hand_held(count, rng) * (0.05 * width, 0.05 * width, np.deg2rad(2))
    else:
        share = float(shake.split()[0]) / 100
        steps = rng.normal(0, (share * width, share * width, np.deg2rad(1)), (count, 3))
    return [rigid(*step, frame_centre(size_wh)) for step in steps]


def estimates(
    keypoints: KeypointName, frames: list[np.ndarray], boxes: list[tuple[float, ...]]
) -> tuple[list[np.ndarray], float]:
    """cur_from_prev of every frame, and the median milliseconds of one."""
    camera = ssiam.CameraMotion(keypoints)
    found, took = [], []
    for index, frame in enumerate(frames):
        start = time.perf_counter()
        motion = camera.update(frame, exclude=boxes[max(index - 1, 0)])
        took.append(1e3 * (time.perf_counter() - start))
        found.append(motion.cur_from_prev)
    return found, float(np.median(took))


def errors(name: str, keypoints: KeypointName, count: int) -> tuple[dict[str, np.ndarray], float]:
    """Error of each frame under each shake, % of the width; and milliseconds a frame."""
    sequence = read_sequence(name)
    with open_source(sequence.frames) as source:
        size_wh = source.size_wh
        frames = [frame.image for frame in islice(source, count)]
    boxes = [tuple(box) for box in sequence.boxes]
    plain, _ = estimates(keypoints, frames, boxes)
    corners = corners_from_xywh((0, 0, *size_wh))
    result, times = {}, []
    for shake in SHAKES:
        shaken_from_raw = poses(shake, len(frames), size_wh, name)
        shaken = [
            cv2.warpAffine(frame, pose[:2], size_wh, borderMode=cv2.BORDER_REFLECT_101)
            for frame, pose in zip(frames, shaken_from_raw, strict=True)
        ]
        moved = [map_box(p, b) for p, b in zip(shaken_from_raw, boxes, strict=False)]
        found, took = estimates(keypoints, shaken, moved)
        times.append(took)
        wanted = [
            cur @ motion @ np.linalg.inv(prev)
            for prev, cur, motion in zip(
                shaken_from_raw, shaken_from_raw[1:], plain[1:], strict=False
            )
        ]
        distances = [
            np.hypot(*(map_points(f, corners) - map_points(w, corners)).T).mean()
            for f, w in zip(found[1:], wanted, strict=True)
        ]
        result[shake] = 100 * np.array(distances) / size_wh[0]
    return result, float(np.median(times))


def main() -> None:
    """Print a table for each generator."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keypoints", default="grid,orb")
    parser.add_argument("--frames", type=int, default=60)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    names = sorted(path.name for path in SEQUENCES.iterdir())
    for keypoints in arguments.keypoints.split(","):
        if keypoints not in get_args(KeypointName):
            parser.error(f"unknown keypoints {keypoints!r}")
        print(
            f"| {keypoints}: median, % of width / frames beyond {FAR:g} % | " + " | ".join(SHAKES),
            end="",
        )
        print(" | ms |\n" + "|---" * (len(SHAKES) + 2) + "|")
        medians, beyond = [], []
        for name in names:
            result, took = errors(name, keypoints, arguments.frames)
            medians.append([np.median(result[shake]) for shake in SHAKES])
            beyond.append([100 * (result[shake] > FAR).mean() for shake in SHAKES])
            cells = [f"{m:.2f} / {b:.0f} %" for m, b in zip(medians[-1], beyond[-1], strict=True)]
            print(f"| {name} | " + " | ".join(cells) + f" | {took:.1f} |", flush=True)
        cells = [
            f"{m:.3f} / mean {b:.1f} %, worst {w:.0f} %"
            for m, b, w in zip(
                np.median(medians, 0), np.mean(beyond, 0), np.max(beyond, 0), strict=True
            )
        ]
        print("| all | " + " | ".join(cells) + " | |\n")


if __name__ == "__main__":
    main()
