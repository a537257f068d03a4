"""The paper's Tables 1 to 4 from measured results, next to the published numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from ssiam.evaluation.measures.compare import paired_difference
from ssiam.evaluation.paper.cells import (
    ABLATION_NAME,
    DECIMALS,
    NO_ENTRY,
    OTHER_HEAD,
    TABLE3_COLUMNS,
    YES_NO,
    Table,
    compared,
    compared_head,
    count,
    measures_of,
    other_cells,
    plain_cells,
    published_method,
    table4_cells,
    table4_head,
)
from ssiam.evaluation.paper.missing import missing_result
from ssiam.evaluation.paper.presets import GENERATORS, THRESHOLDS
from ssiam.evaluation.paper.published import (
    ABLATION_TRACKER,
    ABLATION_YEAR,
    OTHER_ROWS,
    PAPER_TRACKERS,
    RELATED_TRACKERS,
    TABLE1,
    TABLE2,
    TABLE3,
    TABLE4,
    LostTargets,
)
from ssiam.evaluation.paper.summary import Summaries, Summary
from ssiam.stabilize import METHODS, StabilizerConfig

_DEFAULTS: Final = tuple(StabilizerConfig(method) for method in METHODS)


def table1(found: Summaries) -> Table:
    """Table 1: every tracker alone and stabilized; on a year of VOT with the paper's rows."""
    chosen = _default_entries(found.entries)
    title = f"Table 1: trackers alone and stabilized, {found.dataset}"
    notes = [line for each in chosen for line in _gain(found, each)]
    paper = {each.label: each for each in TABLE1 if each.year == found.year}
    if not paper:
        rows = [
            (each.tracker, _method(each), *plain_cells(measures_of(each)), *other_cells(each))
            for each in chosen
        ]
        return Table(title, ("tracker", "stabilized", *DECIMALS, *OTHER_HEAD), rows, notes)
    rows = []
    for each in chosen:
        theirs = paper.get(_paper_label(each))
        cells = compared(measures_of(each), theirs.measures if theirs else None)
        rows.append((each.tracker, _method(each), *cells, *other_cells(each), ""))
    notes += _related_notes(chosen)
    measured = {each.plain_label for each in chosen}
    for label, row in paper.items():
        if label not in measured:
            cells = compared(None, row.measures)
            reason = missing_result(label, "table1")
            rows.append((row.tracker, published_method(row), *cells, *NO_ENTRY, reason))
    head = ("tracker", "stabilized", *compared_head(), *OTHER_HEAD, "missing")
    return Table(title, head, rows, notes)


def other_sources(found: Summaries) -> Table:
    """Results that others than the paper have published for the dataset, beside the same ours."""
    measured = {each.plain_label: measures_of(each) for each in reversed(found.entries)}
    rows = [
        (
            *(each.tracker, each.source),
            *compared(measured.get(each.label), each.measures),
            count(each.lost),
        )
        for each in OTHER_ROWS
        if each.year == found.year
    ]
    head = ("tracker", "source", *compared_head("their"), "their lost")
    return Table(f"Other published results, {found.dataset}", head, rows)


def table2(found: Summaries) -> Table:
    """Table 2: results by keypoint generator of the camera motion."""
    rows = []
    configs = {"off": StabilizerConfig("off"), **GENERATORS}
    for tracker in _varied(found, GENERATORS.values()):
        named = {name: found.find(tracker, config) for name, config in configs.items()}
        for name, each in named.items():
            rows.append(
                (
                    *(tracker, name),
                    *compared(measures_of(each), TABLE2.get(name)),
                    *other_cells(each),
                    "" if each else missing_result(f"{tracker}-paper", "table2"),
                )
            )
    head = ("tracker", "keypoints", *compared_head(), *OTHER_HEAD, "missing")
    title = f"Table 2: keypoint generators, {found.dataset}"
    return Table(title, head, rows, _difference_notes(found, rows))


def table3(found: Summaries) -> Table:
    """Table 3: results by threshold of eq. 6, varied one at a time."""
    rows = []
    for tracker in _varied(found, [each for row in THRESHOLDS.values() for each in row.values()]):
        for threshold, configs in THRESHOLDS.items():
            paper = TABLE3[threshold.partition(",")[0]]
            named = {value: found.find(tracker, each) for value, each in configs.items()}
            for value, each in named.items():
                rows.append(
                    (
                        *(tracker, threshold, f"{value:g}"),
                        *compared(measures_of(each), paper.get(value), TABLE3_COLUMNS),
                        *other_cells(each),
                        "" if each else missing_result(f"{tracker}-paper", "table3"),
                    )
                )
    measures = compared_head(columns=TABLE3_COLUMNS)
    head = ("tracker", "threshold", "value", *measures, *OTHER_HEAD, "missing")
    title = f"Table 3: thresholds, {found.dataset}"
    return Table(title, head, rows, _difference_notes(found, rows))


def table4_sequences(found: Summaries, names: Iterable[str] = ()) -> list[str]:
    """Sequences of the dataset in Table 4: those in `names`, and where a run or the paper lost one.

    Empty without supervised runs.
    """
    chosen = _supervised(found)
    named = {*names, *_table4_of_the_paper(found)}
    return [
        name
        for name in (found.sequences if chosen else ())
        if name in named or any(each.lost.get(name, 0) for each in chosen)
    ]


def table4(
    found: Summaries, names: Iterable[str] = (), judged: Mapping[str, bool] | None = None
) -> Table:
    """Table 4: lost targets by sequence, for `table4_sequences` and the paper's.

    Parameters
    ----------
    found : Summaries
    names : iterable of str
        Sequences that are listed even if no run lost its target.
    judged : mapping of str to bool, optional
        Whether the threshold judge stabilizes a sequence, of those that were judged.
    """
    chosen, paper = _supervised(found), _table4_of_the_paper(found)
    listed = table4_sequences(found, names)
    listed += [name for name in paper if name not in listed]
    lost = {each.plain_label: each.lost for each in reversed(chosen)}
    rows = [
        (
            name,
            YES_NO[(judged or {}).get(name)],
            *(count(each.lost.get(name)) for each in chosen),
            *table4_cells(name, paper, lost, _missing_lost(name, found, lost)),
        )
        for name in listed
    ]
    if chosen:
        empty = ("",) * len(table4_head(paper))
        rows.append(
            ("all sequences", "", *(count(sum(each.lost.values())) for each in chosen), *empty)
        )
    head = ("sequence", "Stabilization", *(each.label for each in chosen), *table4_head(paper))
    untouched = len(set(found.sequences) - set(listed))
    left_out = f"{untouched} of {len(found.sequences)} sequences"
    notes = [
        f"Left out because no run lost its target there: {left_out}.",
        "Stabilization: whether the threshold judge finds shake in more than half of the frames.",
    ]
    if paper:
        notes.append(f"The paper's columns and the differences are of {ABLATION_TRACKER}.")
    return Table(f"Table 4: lost targets, {found.dataset}", head, rows, notes)


def _supervised(found: Summaries) -> list[Summary]:
    return [each for each in _default_entries(found.entries) if each.supervised]


def _table4_of_the_paper(found: Summaries) -> Mapping[str, LostTargets]:
    return TABLE4 if found.year == ABLATION_YEAR else {}


def _missing_lost(name: str, found: Summaries, lost: Mapping[str, Mapping[str, float]]) -> str:
    """What is needed for lost targets of the paper's tracker on a sequence of VOT2018."""
    if name not in found.sequences:
        return f"VOT{ABLATION_YEAR}"
    labels = [f"{ABLATION_NAME}-{method}" for method in ("off", "paper")]
    if all(name in lost.get(label, {}) for label in labels):
        return ""
    return missing_result(labels[0], "table4")


def _default_entries(entries: Iterable[Summary]) -> list[Summary]:
    """Entries with default settings, and those of other programs."""
    return [each for each in entries if each.config is None or each.config in _DEFAULTS]


def _varied(found: Summaries, configs: Iterable[StabilizerConfig]) -> list[str]:
    """Trackers with results of a configuration that is not a default; and the paper's, with any."""
    wanted = tuple(configs)
    trackers = dict.fromkeys(
        each.tracker
        for each in found.entries
        if each.config in wanted
        and (each.config not in _DEFAULTS or _is_of_the_papers_ablation(each))
    )
    return list(trackers)


def _is_of_the_papers_ablation(summary: Summary) -> bool:
    return summary.plain_label.startswith(f"{ABLATION_NAME}-")


def _paper_label(summary: Summary) -> str:
    """Label of the row of Table 1 beside which a summary is set."""
    tracker, _, method = summary.plain_label.rpartition("-")
    return f"{RELATED_TRACKERS.get(tracker, tracker)}-{method}"


def _related_notes(chosen: Iterable[Summary]) -> list[str]:
    """A line for each tracker that is set beside another one of the paper."""
    related = {each.tracker: _paper_label(each) for each in chosen}
    titles = {name: title for title, name in PAPER_TRACKERS.items()}
    return [
        f"{tracker} is set beside the paper's {titles[beside]}: the differences contain those of "
        "weights, backbone or boxes."
        for tracker, label in related.items()
        if (beside := label.rpartition("-")[0]) in titles and tracker.partition(" (")[0] != beside
    ]


def _difference_notes(found: Summaries, rows: Iterable[tuple[str, ...]]) -> list[str]:
    """A line if the differences are not only those of the runs."""
    names = list(dict.fromkeys(row[0] for row in rows))
    trackers = ", ".join(names)
    if (
        all(each.partition(" (")[0] == ABLATION_NAME for each in names)
        and found.year == ABLATION_YEAR
    ):
        return []
    return [
        f"The paper's numbers are of {ABLATION_TRACKER} on VOT{ABLATION_YEAR}, ours of {trackers} "
        f"on {found.dataset}: the differences contain those of tracker and dataset."
    ]


def _method(summary: Summary) -> str:
    return "" if summary.config is None else summary.config.stabilize


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
