"""J of the small tracker's masks over the probability from which a pixel is the target's.

    python benchmarks/mask_threshold.py DAVIS [--weights FOLDER] [--videos a,b,...] [--jobs 2]

DAVIS and videos as in benchmarks/masks.py. Prints J of every threshold, and at last what is to be
expected of new videos: the mean J of each video under the threshold that is best for the others.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import joblib
import numpy as np

import ssiam
from masks import HELD_OUT, jaccard
from ssiam.runtime import Running
from ssiam.trackers.lite import SHIPPED, LiteNetworks, LiteTracker

THRESHOLDS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5)


def of_video(weights: Path, root: Path, video: str) -> list[float]:
    """J of a video with each threshold."""
    cv2.setNumThreads(1)
    networks = LiteNetworks.load(weights, Running("openvino", 1))
    config = ssiam.StabilizerConfig("off")
    trackers = [LiteTracker(networks, mask_threshold=each) for each in THRESHOLDS]
    return [jaccard(ssiam.StabilizedTracker(each, config), root, video) for each in trackers]


def of_new_videos(by_video: np.ndarray) -> float:
    """Mean J (videos, thresholds) -> of each video, the threshold chosen on the others."""
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
        joblib.delayed(of_video)(arguments.weights, arguments.davis, video)
        for video in arguments.videos.split(",")
    ]
    by_video = np.array(joblib.Parallel(arguments.jobs)(runs))
    print("| threshold | J |\n|---|---|")
    for threshold, mean in zip(THRESHOLDS, by_video.mean(axis=0), strict=True):
        print(f"| {threshold} | {mean:.3f} |")
    print(f"| of the other videos | **{of_new_videos(by_video):.3f}** |")


if __name__ == "__main__":
    main()
