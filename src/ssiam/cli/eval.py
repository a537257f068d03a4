"""`ssiam eval`: A, R and EAO of raw result files."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from cyclopts import Parameter
from rich.console import Console

from ssiam.datasets import Sequence as Truth
from ssiam.datasets import open_dataset
from ssiam.errors import ArgumentError, IncompleteError, SsiamError, one_line
from ssiam.evaluation.measures.eao import interval_of
from ssiam.evaluation.reports import (
    Comparison,
    TrackerReport,
    compared,
    comparisons_table,
    holds_one_pass,
    one_pass,
    one_pass_table,
    report,
    scores_table,
    tags_table,
)
from ssiam.evaluation.runs.result_files import ResultsError, read_results
from ssiam.evaluation.runs.shaken_results import shaken_as

Measured = TypeVar("Measured")

# Width of the tables where they do not go to a terminal, characters.
_FILE_WIDTH = 120


def evaluate(
    results: Path,
    /,
    *,
    dataset: Path,
    year: int | None = None,
    experiment: Literal["baseline", "realtime", "ope"] = "baseline",
    compare: Annotated[bool, Parameter(negative=())] = False,
    json_output: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> None:
    """Accuracy, robustness and EAO of raw VOT results, or success of one-pass results.

    A, R and EAO are printed twice, for the numbers differ: as pysot-toolkit computes them, whose
    robustness is lost targets per 100 frames and stands in most papers' tables, and as the
    official vot-toolkit 0.7.4 does, whose robustness is lost targets per sequence.

    Parameters
    ----------
    results
        Folder of a tracker, which holds baseline/SEQUENCE/SEQUENCE_001.txt, or a folder of such
        folders. Where it holds a shake.json of ssiam bench, the truth is shaken as that says.
    dataset
        The dataset: a folder, or pysot's .json file; images are not needed, but the first of each
        sequence where the results were shaken and the dataset does not tell the frames' size.
    year
        Year of VOT whose lengths of sequences EAO is taken over; by default the one in the
        dataset's name.
    experiment
        Which runs: baseline or realtime (supervised, as in VOT), or ope: one pass, with the
        measures of OTB, LaSOT and GOT-10k. One-pass results are SEQUENCE.txt (1-based boxes),
        or lie as GOT-10k's and VOT's do.
    compare
        Compare each of several trackers with the first, sequence by sequence.
    json_output
        Print JSON instead of tables.
    """
    if not results.is_dir():
        raise ResultsError(f"{results}: there is no such folder; give a tracker's results")
    opened = shaken_as(results, open_dataset(dataset))
    if experiment == "ope":
        if compare:
            raise ArgumentError("--compare is for supervised runs; leave it out with ope")
        _one_pass(results, list(opened.sequences.values()), json_output)
        return
    folders = _trackers(results, experiment)
    interval = interval_of(opened.name, year)
    if compare and len(folders) == 1:
        raise ArgumentError(f"{results}: --compare needs the results of several trackers")
    sequences = list(opened.sequences.values())
    reports, left_out = _each(
        folders, lambda folder: report(read_results(folder, sequences, experiment), interval)
    )
    for each in reports:
        _complain(each.notes)
    comparisons = compared(reports) if compare and len(reports) > 1 else []
    if json_output:
        print(json.dumps(_document(reports, comparisons, len(folders) == 1), allow_nan=False))
    else:
        _show(reports, comparisons)
    _check_whole(left_out, len(folders))


def _one_pass(results: Path, sequences: Sequence[Truth], json_output: bool) -> None:
    inside = sorted(path for path in results.iterdir() if path.is_dir() and holds_one_pass(path))
    direct = any((results / f"{each.name}.txt").is_file() for each in sequences) or any(
        (results / each.name).is_dir() for each in sequences
    )
    alone = direct or (results / "ope").is_dir() or (results / "unsupervised").is_dir()
    folders = [results] if alone else inside
    if not folders:
        raise ResultsError(f"{results}: neither it nor a folder in it holds one-pass results")
    reports, left_out = _each(folders, lambda folder: one_pass(folder, sequences))
    for each in reports:
        _complain(each.notes)
    if json_output:
        found = {each.name: each.as_dict() for each in reports}
        print(json.dumps(reports[0].as_dict() if alone else {"trackers": found}))
    else:
        _console().print(one_pass_table(reports))
    _check_whole(left_out, len(folders))


def _each(
    folders: Sequence[Path], measure: Callable[[Path], Measured]
) -> tuple[list[Measured], list[str]]:
    """What is measured of each tracker's folder, and a line for each that cannot be.

    Raises
    ------
    SsiamError
        None of them can be.
    """
    measured, left_out = [], []
    for folder in folders:
        try:
            measured.append(measure(folder))
        except SsiamError as error:
            if len(folders) == 1:
                raise
            left_out.append(one_line(error))
    if not measured:
        raise ResultsError(left_out[0])
    return measured, left_out


def _check_whole(left_out: Sequence[str], trackers: int) -> None:
    """Raise `IncompleteError` if trackers had to be left out."""
    _complain([f"{reason}; the tracker is left out" for reason in left_out])
    if left_out:
        raise IncompleteError(f"{len(left_out)} of {trackers} trackers could not be measured")


def _console() -> Console:
    return Console(width=None if sys.stdout.isatty() else _FILE_WIDTH)


def _trackers(results: Path, experiment: str) -> list[Path]:
    """The folders of trackers: the one that is given, or those in it, by name."""
    if (results / experiment).is_dir():
        return [results]
    found = sorted(path for path in results.iterdir() if (path / experiment).is_dir())
    if not found:
        raise ResultsError(
            f"{results}: neither it nor a folder in it holds {experiment}/SEQUENCE/SEQUENCE_001.txt"
        )
    return found


def _complain(notes: Sequence[str]) -> None:
    for note in notes:
        print(f"ssiam: {' '.join(note.split())}", file=sys.stderr)


def _document(
    reports: Sequence[TrackerReport], comparisons: Sequence[Comparison], is_single: bool
) -> dict[str, Any]:
    if is_single:
        return reports[0].as_dict()
    document: dict[str, Any] = {"trackers": {each.name: each.as_dict() for each in reports}}
    if comparisons:
        document["comparison"] = {each.name: each.as_dict() for each in comparisons}
    return document


def _show(reports: Sequence[TrackerReport], comparisons: Sequence[Comparison]) -> None:
    console = _console()
    console.print(scores_table(reports))
    if any(each.by_tag for each in reports):
        console.print(tags_table(reports))
    if comparisons:
        console.print(comparisons_table(comparisons))
