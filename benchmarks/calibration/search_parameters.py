"""Search parameters and memory of lite: success for each combination, on held-out videos.

    python benchmarks/calibration/search_parameters.py CONFIG [--weights FOLDER] [--frames 80]
        [--penalty-k 0.1 ...] [--window-influence 0.3 ...] [--lr 0.4 ...] [--memory 10 ...]
        [--every 1] [--jobs 2]

CONFIG is a training config (configs/lite_shipped/tracker.toml): the sequences are those of its
[[validation.held_out]], on which the network was not trained. Every combination tracks them with
off; the datasets without a name, whose frames follow each other, also shaken by 3 % with predict.
Prints the success of each, and their mean, the best last. --every 3 uses every third sequence of
the named datasets. The memory is the number of frames between two recent templates, 0 for none.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache
from itertools import islice, product
from pathlib import Path
from typing import NamedTuple

import cv2
import joblib
import numpy as np

import ssiam
from ssiam.datasets import Shake, VideoSequence, shaken
from ssiam.evaluation.measures.success import success
from ssiam.geometry import XYWH, Image
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import FrameView, Method
from ssiam.trackers.lite import MEMORY, PARAMETERS, SHIPPED, LiteNetworks, LiteTracker, Memory
from ssiam.trackers.siamese import SearchParameters
from ssiam.training.config import read_config
from ssiam.training.validation import held_out_sequences


class Candidate(NamedTuple):
    """One combination."""

    parameters: SearchParameters
    memory: Memory


class Run(NamedTuple):
    """One way to track a sequence; `name` is the column of its results."""

    name: str
    sequence: VideoSequence
    stabilize: Method
    shake: Shake


def scores(weights: Path, run: Run, frames: int, candidates: Sequence[Candidate]) -> list[float]:
    """Success of each candidate on the first frames of a sequence."""
    cv2.setNumThreads(1)
    networks = _networks(weights)
    sequence = shaken(run.sequence, run.shake)
    images = list(islice(sequence.images(), min(frames, len(sequence.truth))))
    truth = np.array([sequence.box(index) for index in range(len(images))])
    found = []
    for candidate in candidates:
        tracker = LiteTracker(networks, candidate.parameters, memory=candidate.memory, masks=False)
        boxes = _tracked(tracker, run.stabilize, images, truth[0].tolist())
        found.append(success(np.array(boxes), truth).auc)
    return found


@lru_cache(maxsize=1)
def _networks(weights: Path) -> LiteNetworks:
    return LiteNetworks.load(weights, RuntimeOptions("openvino", 1))


def _tracked(
    tracker: LiteTracker, stabilize: Method, images: list[Image], xywh: XYWH
) -> list[XYWH]:
    """The boxes; with off the sizes of the frames may differ, as those of cropped tracks do."""
    if stabilize == "off":
        tracker.init(FrameView(images[0]), xywh)
        return [xywh, *(tracker.update(FrameView(image)).box for image in images[1:])]
    stabilized = ssiam.StabilizedTracker(tracker, ssiam.StabilizerConfig(stabilize))
    stabilized.init(images[0], xywh)
    return [xywh, *(stabilized.update(image).box for image in images[1:])]


def runs_of(config: Path, every: int) -> list[Run]:
    """All runs on the held-out sequences of a training config."""
    validation = read_config(config).validation
    runs = []
    for held_out in validation.held_out if validation else ():
        sequences = list(held_out_sequences(held_out))
        if held_out.name:
            runs += [Run(held_out.name, each, "off", Shake(0.0)) for each in sequences[::every]]
            continue
        runs += [Run("off", each, "off", Shake(0.0)) for each in sequences]
        shake = Shake(0.03, "handheld")
        runs += [Run("predict, shaken", each, "predict", shake) for each in sequences]
    return runs


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", type=Path)
    parser.add_argument("--weights", type=Path, default=SHIPPED)
    parser.add_argument("--frames", type=int, default=80)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--penalty-k", type=float, nargs="+", default=[PARAMETERS.penalty_k])
    parser.add_argument(
        "--window-influence", type=float, nargs="+", default=[PARAMETERS.window_influence]
    )
    parser.add_argument("--lr", type=float, nargs="+", default=[PARAMETERS.lr])
    parser.add_argument("--memory", type=int, nargs="+", default=[MEMORY.interval])
    chosen = parser.parse_args()
    candidates = [
        Candidate(SearchParameters(penalty_k, window, lr), Memory(interval))
        for penalty_k, window, lr, interval in product(
            chosen.penalty_k, chosen.window_influence, chosen.lr, chosen.memory
        )
    ]
    runs = runs_of(chosen.config, chosen.every)
    jobs = [
        joblib.delayed(scores)(chosen.weights, each, chosen.frames, candidates) for each in runs
    ]
    by_column = defaultdict(list)
    for run, found in zip(runs, joblib.Parallel(chosen.jobs)(jobs), strict=True):
        by_column[run.name].append(found)
    means = np.array([np.mean(found, axis=0) for found in by_column.values()])
    overall = means.mean(axis=0)
    print(f"| mean | {' | '.join(by_column)} | penalty_k | window_influence | lr | memory |")
    print("|" + "---|" * (len(by_column) + 5))
    for index in np.argsort(overall):
        parameters, memory = candidates[index]
        found = " | ".join(f"{value:.4f}" for value in (overall[index], *means[:, index]))
        values = parameters.penalty_k, parameters.window_influence, parameters.lr, memory.interval
        print(f"| {found} | {' | '.join(map(str, values))} |")


if __name__ == "__main__":
    main()
