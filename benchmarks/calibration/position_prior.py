"""How fast ranks fall off with the distance from the prediction: success on held-out videos.

    python benchmarks/calibration/position_prior.py VIDEOS [--clips FOLDER ...] [--frames 60]
        [--trackers lite ...] [--halving 0.5 ...] [--per-error 10 ...]

VIDEOS is a folder of sequences that lite was not trained on (ten of DAVIS); they are tracked with
predict, as they are and shaken by 3 % (hand-held) and 5 % (white noise). The clips, in
MOTChallenge's layout, show several objects of one kind, each of which is tracked in up to 90 frames
as in benchmarks/accuracy/distractors.py; for them the column is the mean overlap. By default they
are ADL-Rundle-6 of the folder of test data, on which nothing is reported. The first row of each
tracker is without the preference (`--no-prefer`); the others have it, also for trackers that do not
have it otherwise.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from itertools import islice, product
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np

import ssiam
from ssiam.datasets import Shake, VideoSequence, open_dataset, shaken
from ssiam.evaluation.measures.success import success
from ssiam.geometry import Image
from ssiam.trackers import position_prior
from ssiam.trackers.candidates import CandidateTracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.accuracy.distractors import outcome, targets
from benchmarks.common.data import MOT
from benchmarks.common.loading import load
from benchmarks.common.tables import line

SHAKES = (Shake(0.0), Shake(0.03, "handheld"), Shake(0.05, "white"))


def one_pass(
    tracker: ssiam.StabilizedTracker, images: list[Image], sequence: VideoSequence
) -> float:
    """Success of one pass over the images."""
    truth = np.array([sequence.box(index) for index in range(len(images))])
    tracker.init(images[0], truth[0].tolist())
    boxes = [truth[0], *(tracker.update(image).box for image in images[1:])]
    return success(np.array(boxes), truth).auc


def columns(
    tracker: ssiam.StabilizedTracker, videos: Path, clips: list[Path], frames: int
) -> Iterator[float]:
    """Success with each shake, then the mean overlap in each clip."""
    for shake in SHAKES:
        found = []
        for sequence in open_dataset(videos).sequences.values():
            seen = shaken(sequence, shake)
            images = list(islice(seen.images(), min(frames, len(seen.truth))))
            found.append(one_pass(tracker, images, seen))
        yield float(np.mean(found))
    for clip in clips:
        yield float(np.mean([outcome(tracker, each).mean for each in targets([clip])]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("videos", type=Path)
    parser.add_argument("--clips", type=Path, nargs="+", default=[MOT / "ADL-Rundle-6"])
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--trackers", nargs="+", default=["lite"])
    parser.add_argument("--halving", type=float, nargs="+", default=[0.5])
    parser.add_argument("--per-error", type=float, nargs="+", default=[10.0])
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    config = ssiam.StabilizerConfig("predict")
    names = [f"{shake.kind} {shake.strength:g}" for shake in SHAKES]
    names += [clip.name for clip in chosen.clips]
    print(line(("tracker", "halving", "per error", *names)))
    print("|---" * (3 + len(names)) + "|")
    values = chosen.videos, chosen.clips, chosen.frames
    for name in chosen.trackers:
        plain = columns(load(name, config.with_options(prefer=False)), *values)
        print(line((name, "-", "-", *(f"{value:.4f}" for value in plain))), flush=True)
        tracker = load(name, config)
        assert isinstance(tracker.view_tracker, CandidateTracker)
        tracker.view_tracker.prefers_prediction = True
        for halving, per_error in product(chosen.halving, chosen.per_error):
            with (
                patch.object(position_prior, "_HALVING", halving),
                patch.object(position_prior, "_HALVING_PER_ERROR", per_error),
            ):
                found = list(columns(tracker, *values))
            cells = (f"{halving:g}", f"{per_error:g}", *(f"{value:.4f}" for value in found))
            print(line((name, *cells)), flush=True)


if __name__ == "__main__":
    main()
