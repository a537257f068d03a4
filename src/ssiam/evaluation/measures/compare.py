"""`paired_difference`: the difference of two sets of results, with a bootstrap interval.

Both sets are from the same sequences, so they are compared sequence by sequence. The bootstrap
resamples the sequences.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from ssiam.errors import ArgumentError, check_choice
from ssiam.evaluation.measures.regions import Floats

Over: TypeAlias = Literal["mean", "sum"]

_RESAMPLES = 10_000
_SEED = 0
# Percentiles of the 95 % interval.
_INTERVAL = (2.5, 97.5)
# Numbers drawn at once: 32 MB of float64.
_BATCH = 4_000_000


@dataclass(frozen=True)
class Difference:
    """First minus second, with its distribution over resampled sequences.

    Attributes
    ----------
    value : float
    low, high : float
        Bounds of the 95 % bootstrap interval.
    share_below_zero : float
        Share of the resamples in which the first is below the second, 0 to 1.
    sequences : int
        Number of sequences that both sets have.
    """

    value: float
    low: float
    high: float
    share_below_zero: float
    sequences: int


def paired_difference(
    first: Mapping[str, float],
    second: Mapping[str, float],
    *,
    over: Over = "mean",
    resamples: int = _RESAMPLES,
    seed: int = _SEED,
) -> Difference:
    """Difference of two sets of results, paired by sequence, with its bootstrap interval.

    Parameters
    ----------
    first, second : mapping of str to float
        A measure by the name of the sequence. A sequence that is in only one set, or nan in one,
        does not count.
    over : "mean" or "sum"
        Statistic over the sequences: the mean (success, accuracy) or the sum (lost targets).
    resamples, seed : int
        The same seed gives the same interval.

    Raises
    ------
    ArgumentError
        The two sets have no sequence in common.
    """
    check_choice("comparison", over, ("mean", "sum"))
    pairs = [(first[name], second[name]) for name in first if name in second]
    differences = np.array([a - b for a, b in pairs], dtype=np.float64)
    differences = differences[~np.isnan(differences)]
    count = len(differences)
    if count == 0:
        raise ArgumentError("the two sets of results have no sequence in common to compare")
    factor = count if over == "sum" else 1
    means = _resampled(differences, resamples, seed)
    low, high = np.percentile(means, _INTERVAL) * factor
    return Difference(
        value=float(differences.mean() * factor),
        low=float(low),
        high=float(high),
        share_below_zero=float((means < 0).mean()),
        sequences=count,
    )


def _resampled(values: Floats, resamples: int, seed: int) -> Floats:
    """Means (resamples,) of resamples of the values, drawn with replacement."""
    rng = np.random.default_rng(seed)
    step = max(1, _BATCH // len(values))
    drawn = []
    for first in range(0, resamples, step):
        shape = min(step, resamples - first), len(values)
        drawn.append(values[rng.integers(0, len(values), shape)].mean(axis=1))
    return np.concatenate(drawn)
