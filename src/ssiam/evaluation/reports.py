"""Reports of ``ssiam eval``: A, R and EAO of supervised runs, success and AO of one-pass runs.

Each report is available as a dict for programs and as a table for the terminal.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures import pysot, vot_toolkit
from ssiam.evaluation.measures.compare import Difference, Over, paired_difference
from ssiam.evaluation.measures.eao import Interval, Scores
from ssiam.evaluation.measures.regions import Floats, upright
from ssiam.evaluation.measures.success import (
    average_overlap,
    got10k_overlaps,
    mean_success,
    success,
)
from ssiam.evaluation.measures.trajectory import Status, TrackedSequence, Trajectory
from ssiam.evaluation.paper.summary import parse_label, parse_variant
from ssiam.evaluation.runs.result_files import (
    ResultsError,
    TrackerResults,
    got10k_path,
    otb_path,
    read_boxes,
    read_vot,
    repetitions,
    vot_path,
)

# The tag of frames with camera motion, which stabilization is for; it is listed first.
_FIRST_TAG = "camera_motion"
_MISSING = "-"
# Key in JSON and tables -> attribute of `OnePassReport`.
_ONE_PASS_FIGURES = {
    "success": "success",
    "precision": "precision",
    "normalised_precision": "normalized_precision",
    "ao": "ao",
    "sr50": "sr50",
    "sr75": "sr75",
    "sequences": "sequences",
}
_UNBOUNDED = (10**6, 10**6)  # px; in place of an unknown frame size


@dataclass(frozen=True)
class TrackerReport:
    """Measures of one tracker's supervised runs by both toolkits' conventions.

    Attributes
    ----------
    name : str
    pysot, vot_toolkit : Scores
    by_tag : mapping of str to Scores
        pysot's conventions, camera_motion first.
    accuracy, lost : mapping of str to float
        By sequence: mean overlap (pysot's), and lost targets.
    notes : tuple of str
        Lines for the user: what was missing or too short, and how it was handled.
    """

    name: str
    pysot: Scores
    vot_toolkit: Scores
    by_tag: Mapping[str, Scores]
    accuracy: Mapping[str, float]
    lost: Mapping[str, float]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """The scores of both conventions, for JSON; None in place of nan."""
        return {key: _plain(getattr(self, key)) for key in ("pysot", "vot_toolkit")}


@dataclass(frozen=True)
class Comparison:
    """Differences of a tracker's accuracy and lost targets from those of a reference tracker.

    A difference is None if no sequence has the measure in both results.
    """

    name: str
    reference: str
    accuracy: Difference | None
    lost: Difference | None

    def as_dict(self) -> dict[str, Any]:
        """Reference and differences, for JSON; None in place of nan."""
        return {
            "reference": self.reference,
            "accuracy": None if self.accuracy is None else _plain(self.accuracy),
            "lost": None if self.lost is None else _plain(self.lost),
        }


def report(results: TrackerResults, interval: Interval | None) -> TrackerReport:
    """Measure the supervised runs of a tracker; without an interval there is no EAO.

    Raises
    ------
    ArgumentError
        The frame size is not known.
    """
    measured = [pysot.measure(each) for each in results.tracked]
    return TrackerReport(
        name=results.name,
        pysot=pysot.scores(measured, interval),
        vot_toolkit=vot_toolkit.scores(results.tracked, interval),
        by_tag={tag: pysot.scores(measured, interval, tag) for tag in _tags(results.tracked)},
        accuracy={each.tracked.name: each.accuracy for each in measured},
        lost={each.name: each.lost for each in results.tracked},
        notes=(*results.notes, *_interval_notes(results, interval)),
    )


def compared(reports: Sequence[TrackerReport]) -> list[Comparison]:
    """Compare each tracker's stabilized runs with its own `off`, and any others with the first.

    The name of a report is the label of ``ssiam bench``, or any other. An `off` with which another
    report is compared is not compared itself.
    """
    by_name = {each.name: each for each in reports}
    alone = {each.name: by_name.get(_unstabilized(each.name)) for each in reports}
    used = {reference.name for reference in alone.values() if reference is not None}
    pairs = [
        (each, alone[each.name] or reports[0])
        for each in reports
        if each.name not in used and (alone[each.name] or each is not reports[0])
    ]
    return [
        Comparison(
            each.name,
            reference.name,
            _difference(each.accuracy, reference.accuracy, "mean"),
            _difference(each.lost, reference.lost, "sum"),
        )
        for each, reference in pairs
    ]


def _difference(
    first: Mapping[str, float], second: Mapping[str, float], over: Over
) -> Difference | None:
    """The paired difference; None if no sequence has a number in both."""
    is_common = any(
        not math.isnan(value) and not math.isnan(second.get(name, math.nan))
        for name, value in first.items()
    )
    return paired_difference(first, second, over=over) if is_common else None


def _unstabilized(label: str) -> str:
    """Label of the same tracker's run without stabilization; empty for it and other names."""
    parsed = parse_label(label)
    if parsed is None or parsed[1].stabilize == "off":
        return ""
    variant = parse_variant(label)
    return "-".join([parsed[0], "off", *variant.split(", ")]) if variant else f"{parsed[0]}-off"


def scores_table(reports: Iterable[TrackerReport]) -> Table:
    """A table with a row per tracker: A, R, EAO and lost targets by both conventions."""
    table = Table("tracker", title="pysot's conventions, then vot-toolkit's")
    for column in ("A", "R /100", "EAO", "lost", "A", "R /seq", "EAO"):
        table.add_column(column, justify="right")
    for each in reports:
        official = each.vot_toolkit
        cells = *_cells(each.pysot), *_cells(official)[:3]
        table.add_row(escape(each.name), *cells)
    return table


def tags_table(reports: Iterable[TrackerReport]) -> Table:
    """A table with a row per tracker and tag, pysot's conventions."""
    table = Table("tracker", "tag", title="by tag, pysot's conventions")
    for column in ("A", "R /100", "EAO", "lost", "frames"):
        table.add_column(column, justify="right")
    for each in reports:
        for tag, found in each.by_tag.items():
            table.add_row(escape(each.name), escape(tag), *_cells(found), str(found.frames))
        table.add_section()
    return table


def comparisons_table(comparisons: Iterable[Comparison]) -> Table:
    """A table with a row per comparison: differences with their 95 % bootstrap intervals."""
    table = Table("tracker", "minus", title="differences, with shares of the resampled sequences")
    for column in ("accuracy", "95 % within", "lower in", "lost", "95 % within", "fewer in"):
        table.add_column(column, justify="right")
    for each in comparisons:
        table.add_row(
            escape(each.name),
            escape(each.reference),
            *_difference_cells(each.accuracy, 3),
            *_difference_cells(each.lost, 1),
        )
    return table


def _interval_notes(results: TrackerResults, interval: Interval | None) -> list[str]:
    """A line if no run is as long as the end of the EAO interval."""
    longest = max(len(run) for each in results.tracked for run in each.runs)
    if interval is None or longest > interval.high:
        return []
    return [
        f"{results.name}: EAO is defined over lengths {interval.low} to {interval.high}, and no "
        f"sequence has more than {longest} frames; it is the mean over the lengths that exist"
    ]


def _tags(tracked: Iterable[TrackedSequence]) -> list[str]:
    """All tags of at least one frame, camera_motion first."""
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


def _difference_cells(found: Difference | None, decimals: int) -> tuple[str, str, str]:
    if found is None:
        return _MISSING, _MISSING, _MISSING
    interval = f"{found.low:+.{decimals}f} .. {found.high:+.{decimals}f}"
    return f"{found.value:+.{decimals}f}", interval, f"{100 * found.share_below_zero:.1f} %"


def _plain(found: Scores | Difference) -> dict[str, float | None]:
    """The fields; None in place of nan, which JSON lacks."""
    return {key: None if math.isnan(value) else value for key, value in asdict(found).items()}


@dataclass(frozen=True)
class OnePassReport:
    """Measures of one tracker's one-pass runs.

    Attributes
    ----------
    name : str
    success, precision, normalized_precision : float
        OTB and LaSOT: area under the success curve, and shares of the frames whose center distance
        is at most 20 pixels, or at most .2 of the target's size; means over the sequences.
    ao, sr50, sr75 : float
        GOT-10k: mean overlap, and shares of frames above .5 and .75; over all frames.
    sequences : int
    notes : tuple of str
        Lines for the user: what was missing or too short, and how it was handled.
    """

    name: str
    success: float
    precision: float
    normalized_precision: float
    ao: float
    sr50: float
    sr75: float
    sequences: int
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """All measures, for JSON; None in place of nan."""
        figures = {key: getattr(self, name) for key, name in _ONE_PASS_FIGURES.items()}
        return {name: None if math.isnan(value) else value for name, value in figures.items()}


def one_pass(folder: Path, sequences: Iterable[VideoSequence]) -> OnePassReport:
    """Measure the one-pass runs of a tracker.

    The result files are ``ope/<sequence>.txt`` or ``<sequence>.txt`` (OTB, LaSOT: 1-based boxes),
    ``<sequence>/<sequence>_001.txt`` (GOT-10k: 0-based boxes) or
    ``unsupervised/<sequence>/<sequence>_001.txt`` (VOT). Sequences without results are left out.

    Raises
    ------
    ResultsError
        A file is damaged, or the folder has no results of any of the sequences.
    """
    curves, overlaps, notes = [], [], []
    for sequence in sequences:
        runs = _runs(folder, sequence.name)
        if not runs:
            notes.append(f"{folder}: no results for sequence {sequence.name}; it is left out")
            continue
        truth = upright(sequence.truth)
        for run in runs:
            if len(run) != len(truth):
                notes.append(
                    f"{folder}: {len(run)} lines for the {len(truth)} frames of {sequence.name}; "
                    "missing frames count as misses"
                )
            boxes = _boxes(run, truth)
            curves.append(success(boxes, truth))
            overlaps.append(got10k_overlaps(boxes, truth, sequence.size_wh or _UNBOUNDED))
    if not curves:
        raise ResultsError(f"{folder}: no one-pass results of the dataset")
    mean, average = mean_success(curves), average_overlap(overlaps)
    return OnePassReport(
        folder.resolve().name,
        mean.auc,
        mean.precision,
        mean.normalized_precision,
        average.ao,
        average.sr50,
        average.sr75,
        len(curves),
        tuple(notes),
    )


def one_pass_table(reports: Sequence[OnePassReport]) -> Table:
    """A table with a row per tracker."""
    table = Table("tracker", *_ONE_PASS_FIGURES)
    for each in reports:
        figures = each.as_dict().values()
        cells = (f"{value:.3f}" if isinstance(value, float) else str(value) for value in figures)
        table.add_row(escape(each.name), *cells)
    return table


def holds_one_pass(folder: Path) -> bool:
    """Whether a folder looks like the one-pass results of a tracker."""
    if (folder / "ope").is_dir() or (folder / "unsupervised").is_dir():
        return True
    return any(folder.glob("*.txt")) or any(folder.glob("*/*_001.txt"))


def _runs(folder: Path, name: str) -> list[Trajectory]:
    for path in (otb_path(folder / "ope", name), otb_path(folder, name)):
        if path.is_file():
            return [read_boxes(path)]
    paths = repetitions(got10k_path(folder, name))
    if paths:
        return [read_boxes(path, origin=0) for path in paths]
    return [
        read_vot(path) for path in repetitions(vot_path(folder, name, experiment="unsupervised"))
    ]


def _boxes(run: Trajectory, truth: Floats) -> Floats:
    """Boxes (N, 4) of a run, one per frame of the ground truth, and the true box at a start."""
    count = min(len(run), len(truth))
    boxes = np.full((len(truth), 4), np.nan)
    started = np.flatnonzero(run.status[:count] == Status.INITIALIZED)
    tracked = np.flatnonzero(run.status[:count] == Status.TRACKED)
    boxes[tracked] = upright(run.regions[tracked])
    boxes[started] = truth[started]
    return boxes
