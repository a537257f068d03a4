"""A, R and EAO as vot-toolkit 0.7.4, the official one, computes them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ssiam.evaluation.eao import Fragment, Interval, expected_overlap, mean_or_nan
from ssiam.evaluation.overlap import toolkit_overlap
from ssiam.evaluation.raster import Floats
from ssiam.evaluation.scores import Scores
from ssiam.evaluation.tracked import TrackedSequence
from ssiam.evaluation.trajectory import Status, Trajectory

# Frames after a start that accuracy leaves out, that start among them.
_BURN_IN = 10
# S of the AR plot, in frames: after how many the plot asks whether the target is still held.
_SENSITIVITY = 30


def scores(tracked: Sequence[TrackedSequence], interval: Interval) -> Scores:
    """A, R and EAO over a dataset.

    Accuracy and robustness are the means over sequences of a run's mean overlap and of its
    number of lost targets, weighted by the sequences' lengths; of a run that is shorter than its
    sequence, which the toolkit refuses, by the length that was run.

    Raises
    ------
    ArgumentError
        The dataset does not tell the size of its frames.
    """
    weights = [max(map(len, each.runs)) for each in tracked]
    accuracies: list[float] = []
    fragments: list[Fragment] = []
    for each in tracked:
        pairs = [(run, _overlaps(each, run)) for run in each.runs]
        accuracies.append(sum(_accuracy(*pair) for pair in pairs) / len(pairs))
        for pair in pairs:
            fragments += _fragments(*pair)
    lost = [each.lost for each in tracked]
    curve = expected_overlap(fragments, max(len(each.overlaps) for each in fragments))
    return Scores(
        accuracy=float(np.average(accuracies, weights=weights)),
        robustness=float(np.average(lost, weights=weights)),
        eao=mean_or_nan(curve[interval.low : interval.high + 1]),
        lost=sum(lost),
        frames=sum(weights),
    )


def ar_point(found: Scores, sequences: int) -> tuple[float, float]:
    """Place in the AR plot: the share of targets still held after 30 frames, and accuracy."""
    mean_length = found.frames / sequences
    return math.exp(-_SENSITIVITY * found.robustness / mean_length), found.accuracy


def _overlaps(tracked: TrackedSequence, run: Trajectory) -> Floats:
    return toolkit_overlap(run.regions, tracked.sequence.truth[: len(run)], tracked.size_wh)


def _accuracy(run: Trajectory, overlaps: Floats) -> float:
    """Mean overlap while tracking; 0 if nothing is left to count."""
    counted = (run.status == Status.TRACKED) & ~run.burning_in(_BURN_IN)
    return float(overlaps[counted].mean()) if counted.any() else 0.0


def _fragments(run: Trajectory, overlaps: Floats) -> Iterator[Fragment]:
    """From each start to the frame before the failure; the last to the end of the run."""
    starts, failures = run.initializations.tolist(), run.failures.tolist()
    if not failures:
        yield Fragment(overlaps, False, 1)
        return
    for start, failure in zip(starts, failures, strict=False):
        yield Fragment(overlaps[start:failure], True, 1)
    if len(starts) > len(failures):
        yield Fragment(overlaps[starts[-1] :], False, 1)
