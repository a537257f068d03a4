"""What one evaluation found: for programs as a dict, for people as tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.markup import escape
from rich.table import Table

from ssiam.evaluation import pysot, vot_toolkit
from ssiam.evaluation.compare import Difference, paired_difference
from ssiam.evaluation.eao import Interval
from ssiam.evaluation.scores import Scores
from ssiam.evaluation.tracked import TrackedSequence, TrackerResults

# The tag that steadying is about; it is told before the others.
_FIRST_TAG = "camera_motion"
_MISSING = "-"


@dataclass(frozen=True)
class TrackerReport:
    """One tracker under both toolkits' conventions.

    Attributes
    ----------
    name : str
    pysot, vot_toolkit : Scores
    by_tag : mapping of str to Scores
        pysot's conventions, camera_motion first.
    accuracy, lost : mapping of str to float
        By sequence: mean overlap (pysot's), and targets lost.
    notes : tuple of str
        Lines for people: what was missing or short, and what was done about it.
    """

    name: str
    pysot: Scores
    vot_toolkit: Scores
    by_tag: Mapping[str, Scores]
    accuracy: Mapping[str, float]
    lost: Mapping[str, float]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Both conventions' scores; None for what cannot be told."""
        return {key: _plain(getattr(self, key)) for key in ("pysot", "vot_toolkit")}


@dataclass(frozen=True)
class Comparison:
    """A tracker against the first one: differences of accuracy and of targets lost."""

    name: str
    reference: str
    accuracy: Difference
    lost: Difference

    def as_dict(self) -> dict[str, Any]:
        """All of it; None for what cannot be told."""
        return {
            "reference": self.reference,
            "accuracy": _plain(self.accuracy),
            "lost": _plain(self.lost),
        }


def report(results: TrackerResults, interval: Interval) -> TrackerReport:
    """Measure what `ssiam.evaluation.tracked.read_results` has read.

    Raises
    ------
    ArgumentError
        The dataset does not tell the size of its frames.
    """
    measured = [pysot.measured(each) for each in results.tracked]
    return TrackerReport(
        name=results.name,
        pysot=pysot.scores(measured, interval),
        vot_toolkit=vot_toolkit.scores(results.tracked, interval),
        by_tag={tag: pysot.scores(measured, interval, tag) for tag in _tags(results.tracked)},
        accuracy={each.tracked.name: each.accuracy for each in measured},
        lost={each.name: each.lost for each in results.tracked},
        notes=(*results.notes, *_short_notes(results, interval)),
    )


def compared(reports: Sequence[TrackerReport]) -> list[Comparison]:
    """Every tracker but the first against the first."""
    reference, *others = reports
    return [
        Comparison(
            each.name,
            reference.name,
            paired_difference(each.accuracy, reference.accuracy),
            paired_difference(each.lost, reference.lost, over="sum"),
        )
        for each in others
    ]


def scores_table(reports: Iterable[TrackerReport]) -> Table:
    """A row a tracker: A, R, EAO and lost targets under both conventions."""
    table = Table("tracker", title="pysot's conventions, then vot-toolkit's")
    for column in ("A", "R /100", "EAO", "lost", "A", "R /seq", "EAO"):
        table.add_column(column, justify="right")
    for each in reports:
        official = each.vot_toolkit
        cells = *_cells(each.pysot), *_cells(official)[:3]
        table.add_row(escape(each.name), *cells)
    return table


def tags_table(reports: Iterable[TrackerReport]) -> Table:
    """A row a tag of a tracker, pysot's conventions."""
    table = Table("tracker", "frames that carry", title="by tag, pysot's conventions")
    for column in ("A", "R /100", "EAO", "lost", "frames"):
        table.add_column(column, justify="right")
    for each in reports:
        for tag, found in each.by_tag.items():
            table.add_row(escape(each.name), escape(tag), *_cells(found), str(found.frames))
        table.add_section()
    return table


def comparisons_table(comparisons: Iterable[Comparison]) -> Table:
    """A row a tracker: its differences from the first one, with their intervals."""
    table = Table("tracker", "minus", title="difference, 95 % of the resampled sequences within")
    for column in ("accuracy", "within", "worse in", "lost", "within", "fewer in"):
        table.add_column(column, justify="right")
    for each in comparisons:
        table.add_row(
            escape(each.name),
            escape(each.reference),
            *_difference_cells(each.accuracy, 3),
            *_difference_cells(each.lost, 1),
        )
    return table


def _short_notes(results: TrackerResults, interval: Interval) -> list[str]:
    longest = max(len(run) for each in results.tracked for run in each.runs)
    if longest > interval.high:
        return []
    return [
        f"{results.name}: EAO is meant for the lengths {interval.low} to {interval.high}, and no "
        f"sequence has more than {longest} frames; it is the mean of what there is"
    ]


def _tags(tracked: Iterable[TrackedSequence]) -> list[str]:
    """All tags that a frame carries; the one that steadying is about first."""
    found = {
        tag: None for each in tracked for tag, frames in each.sequence.tags.items() if frames.any()
    }
    found.pop(pysot.ALL, None)
    return sorted(found, key=lambda tag: tag != _FIRST_TAG)


def _cells(found: Scores) -> tuple[str, str, str, str]:
    measures = (found.accuracy, found.robustness, found.eao)
    accuracy, robustness, eao = (
        _MISSING if math.isnan(value) else f"{value:.3f}" for value in measures
    )
    return accuracy, robustness, eao, f"{found.lost:g}"


def _difference_cells(found: Difference, decimals: int) -> tuple[str, str, str]:
    within = f"{found.low:+.{decimals}f} .. {found.high:+.{decimals}f}"
    return f"{found.value:+.{decimals}f}", within, f"{100 * found.share_below_zero:.1f} %"


def _plain(found: Scores | Difference) -> dict[str, float | None]:
    """The fields; None for nan, which JSON has not."""
    return {key: None if math.isnan(value) else value for key, value in asdict(found).items()}
