"""A, R and EAO as the official toolkit, vot-toolkit 0.7.4, computes them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ssiam.evaluation.measures.eao import Fragment, Interval, Scores, expected_overlap, mean_or_nan
from ssiam.evaluation.measures.overlap import toolkit_overlap
from ssiam.evaluation.measures.regions import Floats
from ssiam.evaluation.measures.trajectory import Status, TrackedSequence, Trajectory

# Frames after a start that accuracy leaves out, the start included.
_BURN_IN = 10
# S of the AR plot: it shows the share of targets that are still tracked after so many frames.
_SENSITIVITY = 30


def scores(tracked: Sequence[TrackedSequence], interval: Interval | None) -> Scores:
    """A, R and EAO over a dataset; no EAO without interval.

    Accuracy and robustness are means over the sequences, weighted by their lengths, of a run's mean
    overlap and of its number of lost targets. A run shorter than its sequence, which the toolkit
    refuses, is weighted by its own length.

    Raises
    ------
    ArgumentError
        The frame size is not known.
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
        eao=mean_or_nan(curve[interval.low : interval.high + 1]) if interval else math.nan,
        lost=sum(lost),
        frames=sum(weights),
    )


def ar_point(found: Scores, sequences: int) -> tuple[float, float]:
    """Point in the AR plot: the share of targets still tracked after 30 frames, and accuracy."""
    mean_length = found.frames / sequences
    return math.exp(-_SENSITIVITY * found.robustness / mean_length), found.accuracy


def _overlaps(tracked: TrackedSequence, run: Trajectory) -> Floats:
    return toolkit_overlap(run.regions, tracked.sequence.truth[: len(run)], tracked.size_wh)


def _accuracy(run: Trajectory, overlaps: Floats) -> float:
    """Mean overlap while tracking; 0 if no frame counts."""
    counted = (run.status == Status.TRACKED) & ~run.burn_in(_BURN_IN)
    return float(overlaps[counted].mean()) if counted.any() else 0.0


def _fragments(run: Trajectory, overlaps: Floats) -> Iterator[Fragment]:
    """Fragments from each start to the frame before the failure; the last to the run's end."""
    starts, failures = run.initializations.tolist(), run.failures.tolist()
    if not failures:
        yield Fragment(overlaps, False, 1)
        return
    for start, failure in zip(starts, failures, strict=False):
        yield Fragment(overlaps[start:failure], True, 1)
    if len(starts) > len(failures):
        yield Fragment(overlaps[starts[-1] :], False, 1)
