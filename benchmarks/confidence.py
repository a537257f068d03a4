"""What each tracker's score is made of: the fit of its confidence, and how well it tells.

    python benchmarks/confidence.py [--trackers nanotrack_v3,...] [--every N] [--jobs N]

Runs every tracker over clips whose target goes away for a while (splices.py), with and without
camera shake, fits P(overlap > .5) to its evidence by logistic regression, every sequence and
outcome counting the same, and prints the numbers for the tracker's `Confidence`. How well they
tell is measured on each sequence with the numbers of a fit to the others. Needs the folder of test
data (see shared_data.py).
"""

from __future__ import annotations

import argparse

import cv2
import joblib
import numpy as np

import ssiam
from loading import load
from shared_data import sequences
from splice import Splice
from splices import splices
from ssiam.geometry import iou

TRACKERS = "nanotrack_v1,nanotrack_v2,nanotrack_v3,kcf,csrt"
SHAKES = (0.0, 0.02)
RIGHT = 0.5  # overlap of a right box
RIDGE = 1e-3  # holds weights back
ROUNDS = 30  # of Newton's method


def gathered(name: str, clips: list[Splice]) -> tuple[np.ndarray, list[str]]:
    """Rows (N, 2 + k) of `evidence` of all clips, and each row's sequence."""
    cv2.setNumThreads(1)
    config = ssiam.StabilizerConfig("predict", find=False)
    tracker = load(name, config)
    rows = [evidence(tracker, clip) for clip in clips]
    names = [clip.name.split()[0] for clip, own in zip(clips, rows, strict=True) for _ in own]
    return np.concatenate(rows), names


def evidence(tracker: ssiam.StabilizedTracker, clip: Splice) -> np.ndarray:
    """Rows (N, 2 + k): whether the box was right, whether the target was gone, the evidence."""
    rows = []
    for index, frame in enumerate(clip.frames()):
        if index == 0:
            tracker.init(frame, clip.truth[0])
            continue
        track = tracker.update(frame)
        told = np.isfinite(clip.truth[index]).all()
        gone = clip.gone[0] <= index < clip.gone[1]
        if track.evidence and (told or gone):
            right = told and iou(np.array([track.box]), clip.truth[index : index + 1])[0] > RIGHT
            rows.append([float(right), float(gone), *track.evidence])
    return np.array(rows)


def fitted(x: np.ndarray, right: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Weights and bias of a logistic regression, by Newton's method."""
    rows = np.column_stack([x, np.ones(len(x))])
    ridge = RIDGE * np.diag([*[1.0] * x.shape[1], 0.0])
    found = np.zeros(rows.shape[1])
    for _ in range(ROUNDS):
        p = chance(rows, found)
        slope = rows.T @ (weight * (right - p)) / len(x) - ridge @ found
        bend = (rows.T * (weight * p * (1 - p))) @ rows / len(x) + ridge
        found = found + np.linalg.solve(bend, slope)
    return found


def chance(rows: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Probability (N,) of each row."""
    return 1 / (1 + np.exp(-np.clip(rows @ found, -30, 30)))


def even(groups: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Weights with which every sequence and each of its two outcomes counts the same."""
    weight = np.ones(len(groups))
    for group in np.unique(groups):
        for outcome in (0, 1):
            those = (groups == group) & (right == outcome)
            if those.any():
                weight[those] = 1 / those.sum()
    return weight / weight.mean()


def held_out(x: np.ndarray, right: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Probability (N,) of each row by a fit without its sequence."""
    rows = np.column_stack([x, np.ones(len(x))])
    p = np.zeros(len(x))
    for group in np.unique(groups):
        own = groups == group
        p[own] = chance(rows[own], fitted(x[~own], right[~own], even(groups[~own], right[~own])))
    return p


def area_under_curve(p: np.ndarray, right: np.ndarray) -> float:
    """Probability that a right box has the higher score of a right and a wrong one."""
    rank = p.argsort().argsort()
    positive = right == 1
    count = positive.sum()
    return float((rank[positive].mean() - (count - 1) / 2) / (len(p) - count))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trackers", default=TRACKERS)
    parser.add_argument("--every", type=int, default=1, help="of so many clips take one")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    steady, shaken = (splices(sequences(), shake)[0] for shake in SHAKES)
    clips = (steady[::2] + shaken[1::2])[:: options.every]
    print("| tracker | weights, bias | area | right: 2, 10, 50 % | wrong: 50, 90 % |")
    print("|---|---|---|---|---|")
    for name in options.trackers.split(","):
        shares = [clips[job :: options.jobs] for job in range(options.jobs)]
        found = joblib.Parallel(options.jobs)(joblib.delayed(gathered)(name, s) for s in shares)
        rows = np.concatenate([part for part, _ in found])
        groups = np.array([sequence for _, names in found for sequence in names])
        right, x = rows[:, 0], rows[:, 2:]
        p = held_out(x, right, groups)
        high = np.quantile(p[right == 1], [0.02, 0.1, 0.5])
        low = np.quantile(p[right == 0], [0.5, 0.9])
        numbers = ", ".join(f"{v:.2f}" for v in fitted(x, right, even(groups, right)))
        print(
            f"| {name} | {numbers} | {area_under_curve(p, right):.3f} "
            f"| {', '.join(f'{v:.2f}' for v in high)} | {', '.join(f'{v:.2f}' for v in low)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
