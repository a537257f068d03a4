"""The paper's Tables 1 to 4 from measured results, with published numbers next to them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from ssiam.evaluation.measures.compare import paired_difference
from ssiam.evaluation.paper.presets import GENERATORS, THRESHOLDS
from ssiam.evaluation.paper.published import ORIGINAL_LOST, ORIGINAL_YEAR, ROWS, Published
from ssiam.evaluation.paper.summary import Summaries, Summary
from ssiam.stabilize import METHODS, StabilizerConfig

_VOT_HEAD: Final = ("A", "R /100", "EAO", "lost", "fps")
_OTHER_HEAD: Final = ("lost", "overlap", "success", "fps")
_PUBLISHED_HEAD: Final = ("their A", "their R", "their EAO", "their lost", "their fps", "source")
_DEFAULTS: Final = tuple(StabilizerConfig(method) for method in METHODS)
_UNKNOWN: Final = "The paper's numbers of this table are not available: their column is empty."


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


def table1(found: Summaries) -> Table:
    """Table 1: every tracker alone and stabilized; with published numbers on a year of VOT."""
    chosen = _default_entries(found.entries)
    notes = [line for each in chosen for line in _gain(found, each)]
    title = f"Table 1: trackers alone and stabilized, {found.dataset}"
    own = {each.label: (each.tracker, _method(each), *_cells(each, found.year)) for each in chosen}
    if found.year is None:
        return Table(title, ("tracker", "stabilized", *_OTHER_HEAD), list(own.values()), notes)
    published = [each for each in ROWS if each.year == found.year]
    theirs = {each.label: _published_cells(each) for each in published if each.label in own}
    empty = ("",) * len(_PUBLISHED_HEAD)
    rows = [(*cells, *theirs.get(label, empty)) for label, cells in own.items()]
    rows += [
        (each.tracker, _published_method(each), *[""] * len(_VOT_HEAD), *_published_cells(each))
        for each in published
        if each.label not in own
    ]
    return Table(title, ("tracker", "stabilized", *_VOT_HEAD, *_PUBLISHED_HEAD), rows, notes)


def published_table(years: Iterable[int]) -> Table:
    """The paper's printed Table 1 for some years of VOT."""
    wanted = set(years)
    rows = [
        (f"VOT{each.year}", each.tracker, _published_method(each), *_published_cells(each)[:-1])
        for each in ROWS
        if each.source == "paper" and each.year in wanted
    ]
    return Table(
        "Table 1 as printed in the paper", ("dataset", "tracker", "stabilized", *_VOT_HEAD), rows
    )


def table2(found: Summaries) -> Table:
    """Table 2: results by keypoint generator of the camera motion."""
    head = ("tracker", "keypoints", *_head(found), "paper")
    rows, notes = [], [_UNKNOWN]
    for tracker in _trackers(found.entries):
        by_name = {"off": StabilizerConfig("off"), **GENERATORS}
        named = {name: found.find(tracker, config) for name, config in by_name.items()}
        for name, each in named.items():
            if each is not None:
                rows.append((tracker, name, *_cells(each, found.year), ""))
        notes += _missing(tracker, "keypoints", named, "table2")
    return Table(f"Table 2: keypoint generators, {found.dataset}", head, rows, notes)


def table3(found: Summaries) -> Table:
    """Table 3: results by threshold of eq. 6, varied one at a time."""
    head = ("tracker", "threshold", "value", *_head(found), "paper")
    rows, notes = [], [_UNKNOWN]
    for tracker in _trackers(found.entries):
        for threshold, configs in THRESHOLDS.items():
            named = {f"{value:g}": found.find(tracker, each) for value, each in configs.items()}
            for name, each in named.items():
                if each is not None:
                    rows.append((tracker, threshold, name, *_cells(each, found.year), ""))
            notes += _missing(tracker, threshold, named, "table3")
    return Table(f"Table 3: thresholds, {found.dataset}", head, rows, notes)


def table4(found: Summaries) -> Table:
    """Table 4: lost targets by sequence, where any run or the paper lost one."""
    chosen = [each for each in _default_entries(found.entries) if each.supervised]
    original = ORIGINAL_LOST if found.year == ORIGINAL_YEAR else {}
    listed = [
        name
        for name in found.sequences
        if name in original or any(each.lost.get(name, 0) for each in chosen)
    ]
    rows = [
        (name, *(_count(each.lost.get(name)) for each in chosen), _count(original.get(name)))
        for name in listed
    ]
    if chosen:
        rows.append(("all sequences", *(_count(sum(each.lost.values())) for each in chosen), ""))
    head = ("sequence", *(each.label for each in chosen), "paper: Original")
    if not original:
        head, rows = head[:-1], [row[:-1] for row in rows]
    left_out = f"{len(found.sequences) - len(listed)} of {len(found.sequences)} sequences"
    notes = [f"Left out because no run lost its target there: {left_out}."]
    return Table(f"Table 4: lost targets, {found.dataset}", head, rows, notes)


def _default_entries(entries: Iterable[Summary]) -> list[Summary]:
    """Entries with default settings, and those of other programs."""
    return [each for each in entries if each.config is None or each.config in _DEFAULTS]


def _trackers(entries: Iterable[Summary]) -> list[str]:
    return list(dict.fromkeys(each.tracker for each in entries if each.config is not None))


def _method(summary: Summary) -> str:
    return "" if summary.config is None else summary.config.stabilize


def _published_method(row: Published) -> str:
    return "paper" if row.tracker.startswith("S-") else "off"


def _gain(found: Summaries, stabilized: Summary) -> list[str]:
    """A line with the difference of lost targets from the tracker without stabilization."""
    off = found.find(stabilized.tracker, StabilizerConfig("off"))
    if off is None or off is stabilized or not set(off.lost) & set(stabilized.lost):
        return []
    change = paired_difference(stabilized.lost, off.lost, over="sum")
    return [
        f"{stabilized.label} against off, lost targets over {change.sequences} sequences: "
        f"{change.value:+g} (95 % of the resampled sequences: {change.low:+g} .. {change.high:+g})"
    ]


def _missing(
    tracker: str, what: str, named: Mapping[str, Summary | None], preset: str
) -> list[str]:
    names = ", ".join(name for name, each in named.items() if each is None)
    line = f"{tracker}, {what}: no results of {names} (ssiam bench ... --preset {preset})"
    return [line] if names else []


def _head(found: Summaries) -> tuple[str, ...]:
    return _OTHER_HEAD if found.year is None else _VOT_HEAD


def _cells(summary: Summary, year: int | None) -> tuple[str, ...]:
    """The cells of the columns in `_head`."""
    lost = _count(sum(summary.lost.values()) if summary.supervised else None)
    fps = _number(summary.fps, 0)
    if year is None:
        overlaps = [value for value in summary.overlaps.values() if not math.isnan(value)]
        mean = sum(overlaps) / len(overlaps) if overlaps else None
        return lost, _number(mean), _number(summary.success.auc), fps
    scores = summary.scores
    if scores is None:
        return "", "", "", lost, fps
    measures = scores.accuracy, scores.robustness, scores.eao
    return (*(_number(value) for value in measures), lost, fps)


def _published_cells(row: Published) -> tuple[str, ...]:
    """The cells of the columns in `_PUBLISHED_HEAD`."""
    measures = (_number(value) for value in (row.accuracy, row.robustness, row.eao))
    return (*measures, _count(row.lost), _number(row.fps, 0), row.source)


def _number(value: float | None, decimals: int = 3) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.{decimals}f}"


def _count(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
