"""Mask threshold of lite: J over the probability from which a pixel belongs to the target.

    python benchmarks/calibration/mask_threshold.py DAVIS [--weights FOLDER] [--videos a,b,...]
        [--jobs 2]

DAVIS and videos as in benchmarks/accuracy/masks.py. Prints J for every threshold, and an estimate
for new videos: the mean J of each video with the threshold that is best for the others.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import joblib
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.runtime import RuntimeOptions
from ssiam.trackers.lite import SHIPPED, LiteNetworks, LiteTracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.accuracy.masks import HELD_OUT, jaccard

THRESHOLDS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5)


def scores_of_video(weights: Path, root: Path, video: str) -> list[float]:
    """J of a video for each threshold."""
    cv2.setNumThreads(1)
    networks = LiteNetworks.load(weights, RuntimeOptions("openvino", 1))
    config = ssiam.StabilizerConfig("off")
    trackers = [LiteTracker(networks, mask_threshold=each) for each in THRESHOLDS]
    return [jaccard(ssiam.StabilizedTracker(each, config), root, video) for each in trackers]


def held_out_score(by_video: NDArray[np.float64]) -> float:
    """Mean J, from J (videos, thresholds), with each video's threshold chosen on the others."""
    rest = by_video.sum(axis=0) - by_video
    return float(np.mean([own[best] for own, best in zip(by_video, rest.argmax(1), strict=True)]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("davis", type=Path)
    parser.add_argument("--weights", type=Path, default=SHIPPED)
    parser.add_argument("--videos", default=HELD_OUT)
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    runs = [
        joblib.delayed(scores_of_video)(arguments.weights, arguments.davis, video)
        for video in arguments.videos.split(",")
    ]
    by_video = np.array(joblib.Parallel(arguments.jobs)(runs))
    print("| threshold | J |\n|---|---|")
    for threshold, mean in zip(THRESHOLDS, by_video.mean(axis=0), strict=True):
        print(f"| {threshold} | {mean:.3f} |")
    print(f"| chosen on the other videos | **{held_out_score(by_video):.3f}** |")


if __name__ == "__main__":
    main()
