"""Masks on held-out DAVIS videos: mean J of a tracker that is started on a box.

    python benchmarks/accuracy/masks.py DAVIS [--tracker lite] [--stabilize off] [--videos a,b,...]

DAVIS is the folder of JPEGImages and Annotations (480p). All labeled objects together are the
target, as in DAVIS 2016. J is the mean overlap of the masks, without the first and the last frame.
The videos are those held out of training (configs/lite.toml).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import read_bgr

HELD_OUT = (
    "blackswan,bmx-trees,breakdance,camel,cows,dance-twirl,drift-straight,goat,parkour,soapbox"
)


def true_mask(path: Path) -> NDArray[np.bool_]:
    """Mask (H, W) of the labeled objects in a frame."""
    return np.asarray(read_bgr(path).any(axis=2), np.bool_)


def box(mask: NDArray[np.bool_]) -> tuple[float, float, float, float]:
    """The upright box (x, y, w, h) of a mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    x, y = columns[0], rows[0]
    return float(x), float(y), float(columns[-1] + 1 - x), float(rows[-1] + 1 - y)


def overlap(mask: NDArray[np.bool_] | None, truth: NDArray[np.bool_]) -> float:
    """Intersection over union of two masks; 1 if both are empty."""
    found = np.zeros_like(truth) if mask is None else mask
    union = (found | truth).sum()
    return float((found & truth).sum() / union) if union else 1.0


def jaccard(tracker: ssiam.StabilizedTracker, root: Path, video: str) -> float:
    """J of one video."""
    frames = sorted((root / "JPEGImages" / "480p" / video).glob("*.jpg"))
    labels = sorted((root / "Annotations" / "480p" / video).glob("*.png"))
    tracker.init(read_bgr(frames[0]), box(true_mask(labels[0])))
    found = [
        overlap(tracker.update(read_bgr(frame)).mask, true_mask(label))
        for frame, label in zip(frames[1:], labels[1:], strict=True)
    ]
    return float(np.mean(found[:-1]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("davis", type=Path)
    parser.add_argument("--tracker", default="lite")
    parser.add_argument("--weights")
    parser.add_argument("--stabilize", default="off")
    parser.add_argument("--videos", default=HELD_OUT)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    tracker = ssiam.load_tracker(
        arguments.tracker, weights=arguments.weights, stabilize=arguments.stabilize
    )
    scores = {}
    print("| video | J |\n|---|---|")
    for video in arguments.videos.split(","):
        scores[video] = jaccard(tracker, arguments.davis, video)
        print(f"| {video} | {scores[video]:.3f} |", flush=True)
    print(f"| mean of {len(scores)} | **{np.mean(list(scores.values())):.3f}** |")


if __name__ == "__main__":
    main()
