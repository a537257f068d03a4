"""Fit of each tracker's confidence score, and how well it separates right and wrong boxes.

    python benchmarks/calibration/confidence.py [--trackers nanotrack_v3,...] [--every N] [--jobs N]
        [--data FOLDER [--short]] [--tracks CONFIG] [--frequent]

Runs every tracker on clips whose target is absent for a while (benchmarks/lost/clips.py), with and
without camera shake, fits P(overlap > .5) to its evidence by logistic regression with equal weight
for each sequence and outcome, and prints the parameters of the tracker's `Confidence`. The quality
is measured on each sequence with a fit to the others. The clips are made of the sequences of the
folder of test data (see benchmarks/common/data.py), or of another folder; --short is for sequences
of 50 to 100 frames. --tracks adds, for lite, the named datasets of the [[validation.held_out]] of a
training config: each track, and one frame of another track, in which the target is absent.
--frequent weights right and wrong boxes as often as they occur, not equally.
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
from ssiam.geometry import iou
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import FrameView
from ssiam.trackers.lite import SHIPPED, LiteNetworks, LiteTracker
from ssiam.training.config import read_config
from ssiam.training.validation import held_out_sequences

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import SEQUENCES, sequences
from benchmarks.common.loading import load
from benchmarks.lost.clips import SHORT_TIMING, TIMING, AbsenceClip, absence_clips

TRACKERS = "nanotrack_v1,nanotrack_v2,nanotrack_v3,kcf,csrt"
SHAKES = (0.0, 0.02)
RIGHT = 0.5  # overlap of a right box
RIDGE = 1e-3  # regularization of the weights
ITERATIONS = 30  # of Newton's method

Floats = NDArray[np.float64]


def rows_of(name: str, clips: list[AbsenceClip]) -> tuple[Floats, list[str]]:
    """Rows (N, 2 + k) of `evidence` of all clips, and the sequence of each row."""
    cv2.setNumThreads(1)
    config = ssiam.StabilizerConfig("predict").with_options(find=False)
    tracker = load(name, config)
    rows = [evidence(tracker, clip) for clip in clips]
    names = [clip.name.split()[0] for clip, own in zip(clips, rows, strict=True) for _ in own]
    return np.concatenate(rows), names


def evidence(tracker: ssiam.StabilizedTracker, clip: AbsenceClip) -> Floats:
    """Rows (N, 2 + k): whether the box is right, whether the target is absent, the evidence."""
    rows = []
    for index, frame in enumerate(clip.frames()):
        if index == 0:
            tracker.init(frame, clip.truth[0].tolist())
            continue
        track = tracker.update(frame)
        known = np.isfinite(clip.truth[index]).all()
        absent = clip.absence[0] <= index < clip.absence[1]
        if track.evidence and (known or absent):
            right = known and iou(np.array([track.box]), clip.truth[index : index + 1])[0] > RIGHT
            rows.append([float(right), float(absent), *track.evidence])
    return np.array(rows)


def rows_of_tracks(config: Path) -> tuple[Floats, list[str]]:
    """As `rows_of`, of the held-out tracks of a training config; tracked by lite with off."""
    validation = read_config(config).validation
    tracks = [
        track
        for held_out in (validation.held_out if validation else ())
        if held_out.name
        for track in held_out_sequences(held_out)
    ]
    tracker = LiteTracker(LiteNetworks.load(SHIPPED, RuntimeOptions()), masks=False)
    rows, names = [], []
    half = len(tracks) // 2
    for track, other in zip(tracks, [*tracks[half:], *tracks[:half]], strict=True):
        views = [FrameView(image) for image, _ in zip(track.images(), track.truth, strict=False)]
        tracker.init(views[0], track.box(0))
        for index, view in enumerate(views[1:], 1):
            found, truth = tracker.update(view), np.array([track.box(index)])
            right = iou(np.array([found.box]), truth)[0] > RIGHT
            rows.append([float(right), 0.0, *found.evidence])
        absent = tracker.seek(FrameView(next(other.images())), other.box(0))
        rows.append([0.0, 1.0, *absent.evidence])
        names += [track.name[:6]] * len(views)
    return np.array(rows), names


def fitted(x: Floats, right: Floats, weight: Floats) -> Floats:
    """Weights and bias (k + 1,) of a logistic regression, by Newton's method."""
    rows = np.column_stack([x, np.ones(len(x))])
    ridge = RIDGE * np.diag([*[1.0] * x.shape[1], 0.0])
    found = np.zeros(rows.shape[1])
    for _ in range(ITERATIONS):
        p = probability(rows, found)
        gradient = rows.T @ (weight * (right - p)) / len(x) - ridge @ found
        hessian = (rows.T * (weight * p * (1 - p))) @ rows / len(x) + ridge
        found = found + np.linalg.solve(hessian, gradient)
    return found


def probability(rows: Floats, found: Floats) -> Floats:
    """Probability (N,) of each row."""
    return np.asarray(1 / (1 + np.exp(-np.clip(rows @ found, -30, 30))))


def weights(groups: NDArray[np.str_], right: Floats, *, balanced: bool) -> Floats:
    """Weights (N,) that give each sequence, and if balanced each of its outcomes, the same sum."""
    weight = np.ones(len(groups))
    for group in np.unique(groups):
        own = groups == group
        for selected in (own & (right == 0), own & (right == 1)) if balanced else (own,):
            if selected.any():
                weight[selected] = 1 / selected.sum()
    return np.asarray(weight / weight.mean())


def held_out(x: Floats, right: Floats, groups: NDArray[np.str_], *, balanced: bool) -> Floats:
    """Probability (N,) of each row, from a fit without its sequence."""
    rows = np.column_stack([x, np.ones(len(x))])
    p = np.zeros(len(x))
    for group in np.unique(groups):
        own = groups == group
        weight = weights(groups[~own], right[~own], balanced=balanced)
        p[own] = probability(rows[own], fitted(x[~own], right[~own], weight))
    return p


def area_under_curve(p: Floats, right: Floats) -> float:
    """Area under the ROC curve: the probability that a right box scores above a wrong one."""
    rank = p.argsort().argsort()
    positive = right == 1
    count = positive.sum()
    return float((rank[positive].mean() - (count - 1) / 2) / (len(p) - count))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trackers", default=TRACKERS, help="names, comma-separated")
    parser.add_argument("--every", type=int, default=1, help="use every n-th clip")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--data", type=Path, default=SEQUENCES)
    parser.add_argument("--short", action="store_true", help="short absences")
    parser.add_argument("--tracks", type=Path, help="training config, for lite")
    parser.add_argument("--frequent", action="store_true", help="outcomes as often as they occur")
    options = parser.parse_args()
    timing = SHORT_TIMING if options.short else TIMING
    videos = sequences(options.data)
    unshaken, shaken = (absence_clips(videos, shake, timing)[0] for shake in SHAKES)
    clips = (unshaken[::2] + shaken[1::2])[:: options.every]
    print("| tracker | weights, bias | area | right: 2, 10, 50 % | wrong: 50, 90 % |")
    print("|---|---|---|---|---|")
    for name in options.trackers.split(","):
        parts = [clips[job :: options.jobs] for job in range(options.jobs)]
        found = joblib.Parallel(options.jobs)(joblib.delayed(rows_of)(name, part) for part in parts)
        if options.tracks and name == "lite":
            found.append(rows_of_tracks(options.tracks))
        rows = np.concatenate([own for own, _ in found])
        groups = np.array([sequence for _, names in found for sequence in names])
        right, x = rows[:, 0], rows[:, 2:]
        p = held_out(x, right, groups, balanced=not options.frequent)
        high = np.quantile(p[right == 1], [0.02, 0.1, 0.5])
        low = np.quantile(p[right == 0], [0.5, 0.9])
        fit = fitted(x, right, weights(groups, right, balanced=not options.frequent))
        numbers = ", ".join(f"{v:.2f}" for v in fit)
        print(
            f"| {name} | {numbers} | {area_under_curve(p, right):.3f} "
            f"| {', '.join(f'{v:.2f}' for v in high)} | {', '.join(f'{v:.2f}' for v in low)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
