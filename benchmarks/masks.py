"""Masks of held-out DAVIS videos: mean J of a tracker that is given the first frame's box alone.

    python benchmarks/masks.py DAVIS [--tracker lite] [--stabilize off] [--videos a,b,...]

DAVIS is the folder of JPEGImages and Annotations (480p). Everything that is labelled counts as one
target, as in DAVIS 2016; J is the mean overlap of the masks, without the first and the last frame.
The videos are those that training left out (configs/lite.toml).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam

HELD_OUT = (
    "blackswan,bmx-trees,breakdance,camel,cows,dance-twirl,drift-straight,goat,parkour,soapbox"
)


def truth(path: Path) -> NDArray[np.bool_]:
    """What is labelled in a frame, (H, W)."""
    return np.asarray(cv2.imread(str(path))).any(axis=2)


def box(mask: NDArray[np.bool_]) -> tuple[float, float, float, float]:
    """The upright box (x, y, w, h) of a mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    x, y = columns[0], rows[0]
    return float(x), float(y), float(columns[-1] + 1 - x), float(rows[-1] + 1 - y)


def overlap(mask: NDArray[np.bool_] | None, true: NDArray[np.bool_]) -> float:
    """Intersection over union; two empty masks are the same."""
    found = np.zeros_like(true) if mask is None else mask
    union = (found | true).sum()
    return float((found & true).sum() / union) if union else 1.0


def jaccard(tracker: ssiam.StabilizedTracker, root: Path, video: str) -> float:
    """J of one video."""
    pictures = sorted((root / "JPEGImages" / "480p" / video).glob("*.jpg"))
    labels = sorted((root / "Annotations" / "480p" / video).glob("*.png"))
    tracker.init(cv2.imread(str(pictures[0])), box(truth(labels[0])))
    found = [
        overlap(tracker.update(cv2.imread(str(picture))).mask, truth(label))
        for picture, label in zip(pictures[1:], labels[1:], strict=True)
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
