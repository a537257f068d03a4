"""What predicting costs where nobody shakes the camera: off and predict on all videos of DAVIS.

    python benchmarks/shake/unshaken.py DAVIS --trackers lite nanotrack_v3 [--jobs 2]

DAVIS is the folder of JPEGImages and Annotations (480p): 50 videos, most from a camera that
follows its target by hand. None of them was looked at when the numbers of `predict` were chosen;
40 are among those that lite was trained on. What is labelled is one target, its box the truth.
Lost targets (VOT-style restarts) and the success of one pass; differences by video with a
bootstrap 95 % interval, and the videos in which the success differs most. NanoTrack needs the
folder of test data (see shared_data.py).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import joblib
import numpy as np

from ssiam.datasets import Sequence
from ssiam.evaluation.measures.compare import paired_difference

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.accuracy.masks import box, truth
from benchmarks.shake.measure import film, load, measured
from benchmarks.shake.records import NO_SHAKE, Run

SETTINGS = ("off", "predict")
TOLD = 3  # videos with the greatest differences
HEAD = "| tracker | off: lost, success | predict | lost | success | most different |"


def video(root: Path, name: str) -> Sequence:
    """A video of DAVIS with the boxes of its masks; nan where nothing is labelled."""
    pictures = sorted((root / "JPEGImages" / "480p" / name).glob("*.jpg"))
    labels = [truth(path) for path in sorted((root / "Annotations" / "480p" / name).glob("*.png"))]
    boxes = [box(label) if label.any() else (np.nan,) * 4 for label in labels]
    return Sequence(name, tuple(pictures), np.array(boxes))


def runs_of(root: Path, name: str, trackers: list[str]) -> list[Run]:
    """What each tracker does with each setting on a video."""
    cv2.setNumThreads(1)
    filmed = film(video(root, name))
    return [
        measured(
            Run(tracker, setting, NO_SHAKE, 0.0, 0, name),
            True,
            load(tracker, setting),
            filmed,
            None,
        )
        for tracker in trackers
        for setting in SETTINGS
    ]


def row(tracker: str, runs: list[Run]) -> str:
    """The table's row of a tracker."""
    off, predict = (
        [run for run in runs if (run.tracker, run.setting) == (tracker, setting)]
        for setting in SETTINGS
    )
    was, now = ({run.sequence: run.success or 0.0 for run in own} for own in (off, predict))
    gains = {name: now[name] - was[name] for name in was}
    lost = paired_difference(
        *({run.sequence: run.lost for run in own} for own in (predict, off)), over="sum"
    )
    gain = paired_difference(now, was)
    cells = [
        tracker,
        *(
            f"{sum(run.lost for run in own)}, {np.mean(list(success.values())):.3f}"
            for own, success in ((off, was), (predict, now))
        ),
        f"{lost.value:+.0f} [{lost.low:+.0f}, {lost.high:+.0f}]",
        f"{gain.value:+.4f} [{gain.low:+.4f}, {gain.high:+.4f}]",
        ", ".join(
            f"{name} {gains[name]:+.3f}"
            for name in sorted(gains, key=lambda name: -abs(gains[name]))[:TOLD]
        ),
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("davis", type=Path)
    parser.add_argument("--trackers", nargs="+", default=["lite"])
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    names = sorted(path.name for path in (arguments.davis / "JPEGImages" / "480p").iterdir())
    todo = (joblib.delayed(runs_of)(arguments.davis, name, arguments.trackers) for name in names)
    runs = [run for found in joblib.Parallel(arguments.jobs)(todo) for run in found]
    print(f"{len(names)} videos\n\n{HEAD}\n{'|---' * 6}|")
    for tracker in arguments.trackers:
        print(row(tracker, runs))


if __name__ == "__main__":
    main()
