"""Expected average overlap (EAO): the interval of each year, and the curve that it averages.

A run falls into fragments, from one start to the next. The curve tells what overlap to expect
over the first i frames of a fragment; a lost target overlaps by 0 for ever after. EAO is the mean
of the curve over the lengths that are usual in the year's dataset.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ssiam.errors import ArgumentError
from ssiam.evaluation.raster import Floats


class Interval(NamedTuple):
    """Lengths of fragments over which EAO is the mean, frames, both included."""

    low: int
    high: int


# The challenges' own constants; pysot-toolkit and vot-toolkit's stacks have the same.
INTERVALS = {
    2015: Interval(108, 371),
    2016: Interval(108, 371),
    2017: Interval(100, 356),
    2018: Interval(100, 356),
    2019: Interval(46, 291),
}


@dataclass(frozen=True, eq=False)
class Fragment:
    """What follows one start of the tracker.

    Attributes
    ----------
    overlaps : (L,) float64
        From the start on, the frame of the start included.
    failed : bool
        Whether it ended with the target lost, and not with the sequence.
    weight : float
    """

    overlaps: Floats
    failed: bool
    weight: float


def vot_year(dataset: str) -> int | None:
    """The year in a dataset's name, of VOT2018 and the like; None if there is none."""
    found = re.search(r"vot[-_ ]?(20\d\d)", dataset, re.IGNORECASE)
    return int(found[1]) if found else None


def known_year(dataset: str) -> int | None:
    """The year of VOT in a dataset's name; None if there is none, or one without an interval."""
    year = vot_year(dataset)
    return year if year in INTERVALS else None


def interval_of(dataset: str, year: int | None = None) -> Interval:
    """The interval of a `year`, or of the year in the dataset's name.

    Raises
    ------
    ArgumentError
        There is none for that year, or no year in the name.
    """
    known = ", ".join(map(str, INTERVALS))
    year = vot_year(dataset) if year is None else year
    if year is None:
        raise ArgumentError(
            f"dataset {dataset!r}: its name tells no year of VOT, whose lengths EAO is taken "
            f"over; give --year ({known})"
        )
    if year not in INTERVALS:
        raise ArgumentError(f"VOT{year} has no EAO of supervised runs; give --year ({known})")
    return INTERVALS[year]


def expected_overlap(fragments: Sequence[Fragment], length: int) -> Floats:
    """The curve (length,): at i the weighted mean, over fragments, of the overlap in frames 1..i.

    The frame of the start does not count (index 0 is 1, by definition); an overlap that is nan
    counts as 0. Fragments that the sequence ended are no part of the curve beyond their end. nan
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
    """Mean of what is a number; nan, without a warning, if nothing is."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")
