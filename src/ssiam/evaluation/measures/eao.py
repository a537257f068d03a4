"""`Scores` (A, R, EAO), and the expected average overlap (EAO) that both VOT toolkits compute.

A run is split into fragments, one from each start of the tracker to the next. The EAO curve gives
the expected mean overlap over the first i frames of a fragment; after a failure the overlap is 0.
EAO is the mean of the curve over the typical sequence lengths of the year's dataset.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.regions import Floats


class Interval(NamedTuple):
    """Fragment lengths over which EAO averages the curve, frames, both ends included."""

    low: int
    high: int


# From the VOT challenges; pysot-toolkit and the stacks of vot-toolkit use the same.
INTERVALS = {
    2015: Interval(108, 371),
    2016: Interval(108, 371),
    2017: Interval(100, 356),
    2018: Interval(100, 356),
    2019: Interval(46, 291),
}


@dataclass(frozen=True, eq=False)
class Fragment:
    """The part of a run that follows one start of the tracker.

    Attributes
    ----------
    overlaps : (L,) float64
        Overlap of each frame from the start on, the start included.
    failed : bool
        Whether the fragment ended with a lost target rather than with the sequence.
    weight : float
    """

    overlaps: Floats
    failed: bool
    weight: float


def vot_year(dataset: str) -> int | None:
    """The year in a dataset's name such as VOT2018; None if there is none."""
    found = re.search(r"vot[-_ ]?(20\d\d)", dataset, re.IGNORECASE)
    return int(found[1]) if found else None


def known_year(dataset: str) -> int | None:
    """The VOT year in a dataset's name; None without one, or if it has no EAO interval."""
    year = vot_year(dataset)
    return year if year in INTERVALS else None


def interval_of(dataset: str, year: int | None = None) -> Interval | None:
    """The EAO interval of `year`, or of the year in the dataset's name.

    Returns
    -------
    Interval or None
        None for a dataset without EAO: its name contains no year of VOT that defines one.

    Raises
    ------
    ArgumentError
        `year` has no interval.
    """
    if year is not None and year not in INTERVALS:
        known = ", ".join(map(str, INTERVALS))
        raise ArgumentError(f"VOT{year} has no EAO of supervised runs; give --year ({known})")
    found = known_year(dataset) if year is None else year
    return None if found is None else INTERVALS[found]


def expected_overlap(fragments: Sequence[Fragment], length: int) -> Floats:
    """The EAO curve (length,): at i the weighted mean over fragments of the mean overlap in 1..i.

    The start frame does not count (index 0 is 1 by definition), and a nan overlap counts as 0.
    A fragment that ended with its sequence does not contribute beyond its end. The curve is nan
    where no fragment has any weight.
    """
    overlaps, weights = np.zeros((len(fragments), length)), np.zeros((len(fragments), length))
    for row, fragment in enumerate(fragments):
        count = len(fragment.overlaps)
        overlaps[row, :count] = np.nan_to_num(fragment.overlaps)
        weights[row, : length if fragment.failed else count] = fragment.weight
    means = overlaps[:, 1:].cumsum(axis=1) / np.arange(1, length)
    weights = weights[:, 1:]
    with np.errstate(invalid="ignore", divide="ignore"):
        curve = (means * weights).sum(axis=0) / weights.sum(axis=0)
    return np.concatenate([[1.0], curve])


def mean_or_nan(values: Floats) -> float:
    """Mean of the values that are not nan; nan, without a warning, if there are none."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")


@dataclass(frozen=True)
class Scores:
    """Measures of one tracker's supervised runs over a dataset, by one toolkit's conventions.

    Attributes
    ----------
    accuracy : float
        Mean overlap while tracking, 0 to 1.
    robustness : float
        Lost targets: per 100 frames by pysot's conventions, per sequence by vot-toolkit's.
    eao : float
        Expected average overlap, 0 to 1; nan if no run is long enough.
    lost : float
        Lost targets, the mean over repetitions.
    frames : int
        Frames of one repetition.
    """

    accuracy: float
    robustness: float
    eao: float
    lost: float
    frames: int
