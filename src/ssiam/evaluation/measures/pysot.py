"""A, R and EAO as pysot-toolkit computes them; most papers' tables use it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ssiam.evaluation.measures.eao import Fragment, Interval, Scores, expected_overlap, mean_or_nan
from ssiam.evaluation.measures.overlap import vot_overlap
from ssiam.evaluation.measures.regions import Floats
from ssiam.evaluation.measures.trajectory import TrackedSequence, Trajectory

ALL = "all"  # the tag of every frame

# Frames after a start that accuracy leaves out, the start included.
_BURN_IN = 10
# Frames from a failure to the next start.
_SKIPPING = 5


@dataclass(frozen=True, eq=False)
class Overlaps:
    """A run with its overlaps.

    Attributes
    ----------
    run : Trajectory
    accuracy : (N,) float64
        Overlap bounded by (W, H) as accuracy uses it; nan in frames that do not count.
    eao : (N,) float64
        Overlap bounded by (W - 1, H - 1) as EAO uses it, as in pysot-toolkit; no burn-in.
    """

    run: Trajectory
    accuracy: Floats
    eao: Floats


@dataclass(frozen=True, eq=False)
class MeasuredSequence:
    """A sequence with the overlaps of every run on it."""

    tracked: TrackedSequence
    overlaps: tuple[Overlaps, ...]

    @property
    def accuracy(self) -> float:
        """Mean overlap of the frames that count; nan if none does."""
        return mean_or_nan(_mean_of_runs(self.overlaps))


def measure(tracked: TrackedSequence) -> MeasuredSequence:
    """The overlaps of a sequence's runs with its ground truth.

    Raises
    ------
    ArgumentError
        The frame size is not known.
    """
    width, height = tracked.size_wh
    found = []
    for run in tracked.runs:
        truth = tracked.sequence.truth[: len(run)]
        accuracy = vot_overlap(run.regions, truth, (width, height))
        accuracy[run.burn_in(_BURN_IN)] = np.nan
        eao = vot_overlap(run.regions, truth, (width - 1, height - 1))
        found.append(Overlaps(run, accuracy, eao))
    return MeasuredSequence(tracked, tuple(found))


def scores(
    sequences: Sequence[MeasuredSequence], interval: Interval | None, tag: str = ALL
) -> Scores:
    """A, R and EAO over a dataset, or over its frames with a given tag.

    Accuracy is the mean over all frames of all sequences, and robustness is the number of lost
    targets per 100 frames. With a tag, both use only the frames that have it, and EAO weights each
    fragment by its share of such frames. Without an interval, EAO is nan.
    """
    accuracies: list[Floats] = []
    lost, frames = 0.0, 0
    for each in sequences:
        repetitions = each.overlaps
        tagged = _tagged(each.tracked, tag)
        counted = tagged[: _longest(repetitions)]
        accuracies.append(_mean_of_runs(repetitions)[counted])
        frames += int(counted.sum())
        lost_by_run = [int(tagged[overlaps.run.failures].sum()) for overlaps in repetitions]
        lost += sum(lost_by_run) / len(repetitions)
    typical = slice(0) if interval is None else slice(interval.low - 1, interval.high)
    return Scores(
        accuracy=mean_or_nan(np.concatenate(accuracies)),
        robustness=100 * lost / frames if frames else float("nan"),
        eao=mean_or_nan(eao_curve(sequences, tag)[typical]),
        lost=lost,
        frames=frames,
    )


def eao_curve(sequences: Sequence[MeasuredSequence], tag: str = ALL) -> Floats:
    """The expected overlap by fragment length, as long as the longest run; see `expected_overlap`.

    Index i belongs to a fragment of i + 1 frames, of which the first is the start.
    """
    fragments = [
        fragment
        for each in sequences
        for overlaps in each.overlaps
        for fragment in _fragments(overlaps, _tagged(each.tracked, tag), 1 / len(each.overlaps))
    ]
    return expected_overlap(fragments, max(_longest(each.overlaps) for each in sequences))


def _tagged(tracked: TrackedSequence, tag: str) -> NDArray[np.bool_]:
    """Mask of the frames with a tag."""
    count = len(tracked.sequence.truth)
    if tag == ALL:
        return np.ones(count, dtype=np.bool_)
    return np.asarray(tracked.sequence.tags.get(tag, np.zeros(count)), dtype=np.bool_)


def _longest(repetitions: Sequence[Overlaps]) -> int:
    return max(len(overlaps.run) for overlaps in repetitions)


def _mean_of_runs(repetitions: Sequence[Overlaps]) -> Floats:
    """Overlap of each frame: the mean over the runs in which it counts; nan if it never does."""
    stacked = np.full((len(repetitions), _longest(repetitions)), np.nan)
    for row, overlaps in enumerate(repetitions):
        stacked[row, : len(overlaps.run)] = overlaps.accuracy
    counted = (~np.isnan(stacked)).sum(axis=0)
    total = np.nansum(stacked, axis=0)
    return np.asarray(np.where(counted > 0, total / np.maximum(counted, 1), np.nan))


def _fragments(overlaps: Overlaps, tagged: NDArray[np.bool_], weight: float) -> Iterator[Fragment]:
    """Fragments from each start to the next, the next start included; the last to the run's end.

    A target lost fewer than `_SKIPPING` frames before the end has no next start: pysot-toolkit then
    treats the run as one that did not fail.
    """
    count = len(overlaps.run)
    starts = [0, *(int(index) + _SKIPPING for index in overlaps.run.failures)]
    starts = [start for start in starts if start <= count]
    for start, following in pairwise(starts):
        share = tagged[start : following + 1].sum() / (following - start + 1)
        yield Fragment(overlaps.eao[start : following + 1], True, weight * float(share))
    last = starts[-1]
    if last < count:
        share = tagged[last:count].sum() / (len(tagged) - last)
        yield Fragment(overlaps.eao[last:], False, weight * float(share))
