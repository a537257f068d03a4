"""Success of the small tracker over its search's three numbers, on videos that nobody trained on.

    python benchmarks/search_parameters.py DATASET [--weights FOLDER] [--frames 80] [--jobs 2]

DATASET is a folder as `ssiam bench` takes it, of the videos that training left out: never that of a
benchmark. Every combination tracks them alone, as they are, and predicted, shaken by 3 %; prints
both and their mean, the best last.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import islice, product
from pathlib import Path
from typing import NamedTuple

import cv2
import joblib
import numpy as np

import ssiam
from ssiam.datasets import Sequence as Clip
from ssiam.datasets import Shake, open_dataset, shaken
from ssiam.evaluation.success import success
from ssiam.runtime import Running
from ssiam.stabilize import Method
from ssiam.trackers.lite import SHIPPED, LiteNetworks, LiteTracker
from ssiam.trackers.siamese import SearchParameters

PENALTY_K = (0.05, 0.1)
WINDOW_INFLUENCE = (0.1, 0.15, 0.2, 0.3)
LR = (0.4, 0.6)


class Setting(NamedTuple):
    """How the videos are seen."""

    stabilize: Method
    shake: Shake


SETTINGS = (Setting("off", Shake(0.0)), Setting("predict", Shake(0.03, "handheld")))


def scores(weights: Path, clip: Clip, frames: int, tried: Sequence[SearchParameters]) -> np.ndarray:
    """Success (settings, parameters) of a clip's first frames."""
    cv2.setNumThreads(1)
    networks = LiteNetworks.load(weights, Running("openvino", 1))
    return np.array([of_setting(networks, clip, frames, tried, each) for each in SETTINGS])


def of_setting(
    networks: LiteNetworks,
    clip: Clip,
    frames: int,
    tried: Sequence[SearchParameters],
    setting: Setting,
) -> list[float]:
    """Success of a clip's first frames with each of the parameters."""
    seen = shaken(clip, setting.shake)
    images = list(islice(seen.images(), frames))
    truth = np.array([seen.box(index) for index in range(len(images))])
    found = []
    for parameters in tried:
        tracker = ssiam.StabilizedTracker(
            LiteTracker(networks, parameters, masks=False),
            ssiam.StabilizerConfig(setting.stabilize),
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
    both = means.mean(axis=0)
    print("| mean | off | predict, shaken | penalty_k | window_influence | lr |")
    print("|---|---|---|---|---|---|")
    for place in np.argsort(both):
        each = tried[place]
        found = " | ".join(f"{value:.4f}" for value in (both[place], *means[:, place]))
        print(f"| {found} | {each.penalty_k} | {each.window_influence} | {each.lr} |")


if __name__ == "__main__":
    main()
