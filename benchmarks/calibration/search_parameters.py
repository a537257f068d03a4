"""Search parameters of lite: success for each combination, on videos held out of training.

    python benchmarks/calibration/search_parameters.py DATASET [--weights FOLDER] [--frames 80]
        [--jobs 2]

DATASET is a folder as for `ssiam bench`, with videos held out of training that are not part of a
benchmark. Every combination tracks them unshaken with off, and shaken by 3 % with predict. Prints
both results and their mean, the best last.
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
from numpy.typing import NDArray

import ssiam
from ssiam.datasets import Shake, VideoSequence, open_dataset, shaken
from ssiam.evaluation.measures.success import success
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import Method
from ssiam.trackers.lite import SHIPPED, LiteNetworks, LiteTracker
from ssiam.trackers.siamese import SearchParameters

PENALTY_K = (0.05, 0.1)
WINDOW_INFLUENCE = (0.1, 0.15, 0.2, 0.3)
LR = (0.4, 0.6)


class Setting(NamedTuple):
    """Stabilization method and shake of a measurement."""

    stabilize: Method
    shake: Shake


SETTINGS = (Setting("off", Shake(0.0)), Setting("predict", Shake(0.03, "handheld")))


def scores(
    weights: Path, sequence: VideoSequence, frames: int, candidates: Sequence[SearchParameters]
) -> NDArray[np.float64]:
    """Success (settings, candidates) on the first frames of a sequence."""
    cv2.setNumThreads(1)
    networks = LiteNetworks.load(weights, RuntimeOptions("openvino", 1))
    return np.array(
        [scores_in_setting(networks, sequence, frames, candidates, each) for each in SETTINGS]
    )


def scores_in_setting(
    networks: LiteNetworks,
    sequence: VideoSequence,
    frames: int,
    candidates: Sequence[SearchParameters],
    setting: Setting,
) -> list[float]:
    """Success of each candidate on the first frames of a sequence."""
    shaken_sequence = shaken(sequence, setting.shake)
    images = list(islice(shaken_sequence.images(), frames))
    truth = np.array([shaken_sequence.box(index) for index in range(len(images))])
    found = []
    for parameters in candidates:
        tracker = ssiam.StabilizedTracker(
            LiteTracker(networks, parameters, masks=False),
            ssiam.StabilizerConfig(setting.stabilize),
        )
        tracker.init(images[0], truth[0].tolist())
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
    candidates = [SearchParameters(*each) for each in product(PENALTY_K, WINDOW_INFLUENCE, LR)]
    sequences = open_dataset(arguments.dataset).sequences.values()
    runs = [
        joblib.delayed(scores)(arguments.weights, each, arguments.frames, candidates)
        for each in sequences
    ]
    means = np.mean(joblib.Parallel(arguments.jobs)(runs), axis=0)
    both = means.mean(axis=0)
    print("| mean | off | predict, shaken | penalty_k | window_influence | lr |")
    print("|---|---|---|---|---|---|")
    for index in np.argsort(both):
        each = candidates[index]
        found = " | ".join(f"{value:.4f}" for value in (both[index], *means[:, index]))
        print(f"| {found} | {each.penalty_k} | {each.window_influence} | {each.lr} |")


if __name__ == "__main__":
    main()
