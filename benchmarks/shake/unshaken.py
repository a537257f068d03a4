"""The effect of predict without synthetic shake: off and predict on all videos of DAVIS.

    python benchmarks/shake/unshaken.py DAVIS --trackers lite nanotrack_v3 [--jobs 2]

DAVIS is the folder of JPEGImages and Annotations (480p): 50 videos, most from a hand-held camera
that follows its target. On them limits of `predict` were chosen, among other videos (decisions 0013
and 0019); lite was trained on 40 of them. All labeled objects together are the target. The table
has lost targets (VOT restarts) and the success of one pass, their differences by video with a
bootstrap 95 % interval, and the videos with the largest differences of success. NanoTrack needs the
folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import joblib
import numpy as np

from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures.compare import paired_difference

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.accuracy.masks import box, true_mask
from benchmarks.shake.measure import cached, load, measured
from benchmarks.shake.records import NO_SHAKE, ShakeRun

SETTINGS = ("off", "predict")
LISTED = 3  # videos with the largest differences
HEAD = "| tracker | off: lost, success | predict | lost | success | most different |"


def video(root: Path, name: str) -> VideoSequence:
    """A video of DAVIS with the boxes of its masks; nan in frames without a label."""
    frames = sorted((root / "JPEGImages" / "480p" / name).glob("*.jpg"))
    labels = [
        true_mask(path) for path in sorted((root / "Annotations" / "480p" / name).glob("*.png"))
    ]
    boxes = [box(label) if label.any() else (np.nan,) * 4 for label in labels]
    return VideoSequence(name, tuple(frames), np.array(boxes))


def runs_of(root: Path, name: str, trackers: list[str]) -> list[ShakeRun]:
    """Run each tracker with each setting on a video."""
    cv2.setNumThreads(1)
    sequence = cached(video(root, name))
    return [
        measured(
            ShakeRun(tracker, setting, NO_SHAKE, 0.0, 0, name),
            True,
            load(tracker, setting),
            sequence,
            None,
        )
        for tracker in trackers
        for setting in SETTINGS
    ]


def row(tracker: str, runs: list[ShakeRun]) -> str:
    """The row of a tracker."""
    off, predict = (
        [run for run in runs if (run.tracker, run.setting) == (tracker, setting)]
        for setting in SETTINGS
    )
    success_off, success_predict = (
        {run.sequence: run.success or 0.0 for run in own} for own in (off, predict)
    )
    gains = {name: success_predict[name] - success_off[name] for name in success_off}
    lost = paired_difference(
        *({run.sequence: run.lost for run in own} for own in (predict, off)), over="sum"
    )
    gain = paired_difference(success_predict, success_off)
    cells = [
        tracker,
        *(
            f"{sum(run.lost for run in own)}, {np.mean(list(success.values())):.3f}"
            for own, success in ((off, success_off), (predict, success_predict))
        ),
        f"{lost.value:+.0f} [{lost.low:+.0f}, {lost.high:+.0f}]",
        f"{gain.value:+.4f} [{gain.low:+.4f}, {gain.high:+.4f}]",
        ", ".join(
            f"{name} {gains[name]:+.3f}"
            for name in sorted(gains, key=lambda name: -abs(gains[name]))[:LISTED]
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
