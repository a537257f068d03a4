"""Success of the small tracker over its search's three numbers, on videos that nobody trained on.

    python benchmarks/search_parameters.py DATASET [--weights FOLDER] [--frames 80] [--jobs 2]

DATASET is a folder as `ssiam bench` takes it, of the videos that training left out: never that of a
benchmark. Prints every combination, the best last.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import islice, product
from pathlib import Path

import cv2
import joblib
import numpy as np

import ssiam
from ssiam.datasets import Sequence as Clip
from ssiam.datasets import open_dataset
from ssiam.evaluation.success import success
from ssiam.runtime import Running
from ssiam.trackers.lite import SHIPPED, LiteNetworks, LiteTracker
from ssiam.trackers.siamese import SearchParameters

PENALTY_K = (0.02, 0.06, 0.12)
WINDOW_INFLUENCE = (0.2, 0.3, 0.4)
LR = (0.3, 0.45, 0.6)


def scores(
    weights: Path, clip: Clip, frames: int, tried: Sequence[SearchParameters]
) -> list[float]:
    """Success of a clip's first frames with each of the parameters."""
    cv2.setNumThreads(1)
    loaded = LiteNetworks.load(weights, Running("openvino", 1))
    networks = LiteNetworks(loaded.template, loaded.search)
    images = list(islice(clip.images(), frames))
    truth = np.array([clip.box(index) for index in range(len(images))])
    found = []
    for parameters in tried:
        tracker = ssiam.SteadiedTracker(
            LiteTracker(networks, parameters), ssiam.StabilizerConfig("off")
        )
        tracker.init(images[0], truth[0])
        boxes = [truth[0], *(tracker.update(image).box for image in images[1:])]
        found.append(success(np.array(boxes), truth).auc)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--weights", type=Path, default=SHIPPED)
    parser.add_argument("--frames", type=int, default=80)
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    tried = [SearchParameters(*each) for each in product(PENALTY_K, WINDOW_INFLUENCE, LR)]
    clips = open_dataset(arguments.dataset).sequences.values()
    runs = [
        joblib.delayed(scores)(arguments.weights, clip, arguments.frames, tried) for clip in clips
    ]
    means = np.mean(joblib.Parallel(arguments.jobs)(runs), axis=0)
    print("| success | penalty_k | window_influence | lr |\n|---|---|---|---|")
    for place in np.argsort(means):
        each = tried[place]
        print(f"| {means[place]:.4f} | {each.penalty_k} | {each.window_influence} | {each.lr} |")


if __name__ == "__main__":
    main()
