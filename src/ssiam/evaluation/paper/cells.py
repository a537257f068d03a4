"""`Table`, and the cells that set a measured number beside the published one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from ssiam.evaluation.paper.published import (
    ABLATION_TRACKER,
    PAPER_TRACKERS,
    LostTargets,
    Measures,
    Published,
)
from ssiam.evaluation.paper.summary import Summary

# The tracker of Tables 2, 3 and 4 by its name here.
ABLATION_NAME: Final = PAPER_TRACKERS[ABLATION_TRACKER]
OTHER_HEAD: Final = ("lost", "overlap", "success")
NO_ENTRY: Final = ("",) * len(OTHER_HEAD)
DECIMALS: Final = {"A": 3, "R": 3, "EAO": 3, "fps": 0}  # by column
TABLE3_COLUMNS: Final = ("A", "R", "EAO")
YES_NO: Final = {True: "Yes", False: "No", None: ""}


@dataclass(frozen=True)
class Table:
    """A table of text cells.

    Attributes
    ----------
    title : str
    head : tuple of str
    rows : list of tuple of str
        As long as `head`; an empty cell is a missing number.
    notes : list of str
        Lines below the table.
    """

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    notes: list[str] = field(default_factory=list)


def measures_of(summary: Summary | None) -> Measures | None:
    """What the summary measured; None without one."""
    if summary is None:
        return None
    scores = summary.scores
    if scores is None:
        return Measures(fps=summary.fps)
    return Measures(scores.accuracy, scores.robustness, scores.eao, summary.fps)


def compared_head(
    theirs: str = "paper", columns: Iterable[str] = tuple(DECIMALS)
) -> tuple[str, ...]:
    """Of each column ours, the published one, and the difference."""
    return tuple(name for each in columns for name in (each, f"{theirs} {each}", f"diff {each}"))


def compared(
    ours: Measures | None, theirs: Measures | None, columns: Iterable[str] = tuple(DECIMALS)
) -> tuple[str, ...]:
    """The cells of the columns in `compared_head`."""
    first, second = (
        dict(zip(DECIMALS, each or Measures(), strict=True)) for each in (ours, theirs)
    )
    cells: list[str] = []
    for name in columns:
        texts = [_number(each[name], DECIMALS[name]) for each in (first, second)]
        # Of the printed numbers, so that a reader who subtracts them finds the same.
        difference = (
            f"{float(texts[0]) - float(texts[1]):+.{DECIMALS[name]}f}" if all(texts) else ""
        )
        cells += [*texts, difference]
    return tuple(cells)


def paper_head(columns: Iterable[str] = tuple(DECIMALS)) -> tuple[str, ...]:
    """The columns of the paper's numbers alone."""
    return tuple(f"paper {name}" for name in columns)


def plain_cells(
    measures: Measures | None, columns: Iterable[str] = tuple(DECIMALS)
) -> tuple[str, ...]:
    """The cells of the measures alone."""
    values = dict(zip(DECIMALS, measures or Measures(), strict=True))
    return tuple(_number(values[name], DECIMALS[name]) for name in columns)


def table4_head(paper: Mapping[str, LostTargets]) -> tuple[str, ...]:
    """The columns of `table4_cells`."""
    columns = (
        "paper Stabilization",
        "paper Original",
        "paper S-Siam",
        "diff Original",
        "diff S-Siam",
        "missing",
    )
    return columns if paper else ()


def table4_cells(
    name: str,
    paper: Mapping[str, LostTargets],
    lost: Mapping[str, Mapping[str, float]],
    missing: str,
) -> tuple[str, ...]:
    """The paper's row of a sequence, the differences of its tracker, and what they need."""
    if not paper:
        return ()
    if name not in paper:
        return ("",) * len(table4_head(paper))
    row = paper[name]
    both = {"off": row.original, "paper": row.stabilized}
    ours = {method: lost.get(f"{ABLATION_NAME}-{method}", {}).get(name) for method in both}
    differences = (
        "" if (own := ours[method]) is None else f"{own - theirs:+g}"
        for method, theirs in both.items()
    )
    return (YES_NO[row.stabilizes], *map(count, both.values()), *differences, missing)


def other_cells(summary: Summary | None) -> tuple[str, ...]:
    """The cells of the columns in `OTHER_HEAD`."""
    if summary is None:
        return NO_ENTRY
    lost = count(sum(summary.lost.values()) if summary.supervised else None)
    overlaps = [value for value in summary.overlaps.values() if not math.isnan(value)]
    mean = sum(overlaps) / len(overlaps) if overlaps else None
    return lost, _number(mean), _number(summary.success.auc if summary.one_pass else None)


def _number(value: float | None, decimals: int = 3) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.{decimals}f}"


def count(value: float | None) -> str:
    """A number of targets; empty without one."""
    return "" if value is None else f"{value:g}"


def published_method(row: Published) -> str:
    """The stabilization of a published row."""
    return "paper" if row.tracker.startswith("S-") else "off"
