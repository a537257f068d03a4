"""`ssiam eval`: A, R and EAO of raw result files."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

from cyclopts import Parameter
from rich.console import Console

from ssiam.datasets import VideoSequence, open_dataset
from ssiam.datasets.sequence import with_size
from ssiam.errors import ArgumentError, IncompleteError, SsiamError, one_line
from ssiam.evaluation.measures.eao import INTERVALS, interval_of
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
from ssiam.evaluation.runs.result_files import (
    Experiment,
    ResultsError,
    read_results,
    repetitions,
    vot_path,
)
from ssiam.evaluation.runs.shaken_results import shaken_as

Measured = TypeVar("Measured")

_EXPERIMENT_OF_FOLDER: Final = {
    "baseline": "baseline",
    "realtime": "realtime",
    "ope": "ope",
    "unsupervised": "ope",
}
# Width of the tables if they do not go to a terminal, characters.
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
    """Measure result files: A, R and EAO of VOT, or success of one-pass runs.

    A is the mean overlap while tracked, R counts lost targets, and EAO is the expected average
    overlap. They are printed in two versions, whose numbers differ: as pysot-toolkit computes
    them, with R per 100 frames, which most papers report, and as the official vot-toolkit 0.7.4
    computes them, with R per sequence.

    Parameters
    ----------
    results
        Folder of a tracker, with files baseline/SEQUENCE/SEQUENCE_001.txt, or a folder of such
        folders, such as --out of ssiam bench. If it contains a shake.json of ssiam bench, the same
        shake is applied to the ground truth.
    dataset
        The dataset: a folder, or pysot's .json file. Images are not needed, except for the first
        of each sequence if the dataset does not give the frame size.
    year
        Year of VOT, which sets the sequence lengths over which EAO is averaged; by default the one
        in the dataset's name. Without either, there is no EAO.
    experiment
        Kind of runs: baseline or realtime (supervised, as in VOT), or ope (one pass), with the
        measures of OTB, LaSOT and GOT-10k. One-pass results are files SEQUENCE.txt (1-based
        boxes), or use the layout of GOT-10k or VOT.
    compare
        Compare each tracker's stabilized runs with its runs without stabilization, and other
        results with the first, sequence by sequence.
    json_output
        Print JSON instead of tables.
    """
    if not results.is_dir():
        raise ResultsError(f"{results}: there is no such folder; give a tracker's results")
    truth = shaken_as(results, open_dataset(dataset))
    if experiment == "ope":
        if compare:
            raise ArgumentError("--compare is for supervised runs; omit it with ope")
        _one_pass(results, list(truth.sequences.values()), json_output)
        return
    folders = _trackers(results, experiment)
    interval = interval_of(truth.name, year)
    if compare and len(folders) == 1:
        raise ArgumentError(f"{results}: --compare needs the results of several trackers")
    sequences = _with_sizes(truth.sequences.values(), folders, experiment)
    reports, omitted = _measure_all(
        folders, lambda folder: report(read_results(folder, sequences, experiment), interval)
    )
    if interval is None:
        _warn([_no_eao(truth.name)])
    for each in reports:
        _warn(each.notes)
    comparisons = compared(reports) if compare and len(reports) > 1 else []
    _warn([line for each in comparisons for line in _incomparable(each)])
    if json_output:
        print(json.dumps(_document(reports, comparisons, len(folders) == 1), allow_nan=False))
    else:
        _print_tables(reports, comparisons)
    _check_complete(omitted, len(folders))


def _no_eao(dataset: str) -> str:
    """Why there is no EAO."""
    years = ", ".join(map(str, INTERVALS))
    return (
        f"{dataset}: no EAO, which averages over the sequence lengths of a year of VOT ({years}) "
        "and the name contains none of them; give --year to use one of these"
    )


def _incomparable(comparison: Comparison) -> list[str]:
    """A line for each measure that no sequence has in both results."""
    measures = {"accuracy": comparison.accuracy, "lost targets": comparison.lost}
    return [
        f"{comparison.name} minus {comparison.reference}: no sequence has {name} in both results"
        for name, found in measures.items()
        if found is None
    ]


def _with_sizes(
    sequences: Iterable[VideoSequence], folders: Sequence[Path], experiment: Experiment
) -> list[VideoSequence]:
    """The sequences, those with results with their frame size, which bounds the overlap."""

    def has_results(name: str) -> bool:
        paths = (vot_path(folder, name, experiment=experiment) for folder in folders)
        return any(repetitions(path) for path in paths)

    found = []
    for each in sequences:
        if each.size_wh is None and has_results(each.name):
            try:
                each = with_size(each)
            except SsiamError as error:
                raise ArgumentError(
                    f"sequence {each.name}: the size of its frames, which bounds the overlap, is "
                    f"not in the dataset and cannot be read from the first image ({error})"
                ) from error
        found.append(each)
    return found


def _one_pass(results: Path, sequences: Sequence[VideoSequence], json_output: bool) -> None:
    subfolders = sorted(
        path for path in results.iterdir() if path.is_dir() and holds_one_pass(path)
    )
    has_sequences = any((results / f"{each.name}.txt").is_file() for each in sequences) or any(
        (results / each.name).is_dir() for each in sequences
    )
    is_tracker = has_sequences or (results / "ope").is_dir() or (results / "unsupervised").is_dir()
    folders = [results] if is_tracker else subfolders
    if not folders:
        raise ResultsError(f"{results}: neither it nor a folder in it holds one-pass results")
    reports, omitted = _measure_all(folders, lambda folder: one_pass(folder, sequences))
    for each in reports:
        _warn(each.notes)
    if json_output:
        by_name = {each.name: each.as_dict() for each in reports}
        print(json.dumps(reports[0].as_dict() if is_tracker else {"trackers": by_name}))
    else:
        _console().print(one_pass_table(reports))
    _check_complete(omitted, len(folders))


def _measure_all(
    folders: Sequence[Path], measure: Callable[[Path], Measured]
) -> tuple[list[Measured], list[str]]:
    """The measurements of each tracker's folder, and one line for each that failed.

    Raises
    ------
    SsiamError
        All of them failed.
    """
    measured, omitted = [], []
    for folder in folders:
        try:
            measured.append(measure(folder))
        except SsiamError as error:
            if len(folders) == 1:
                raise
            omitted.append(one_line(error))
    if not measured:
        raise ResultsError(omitted[0])
    return measured, omitted


def _check_complete(omitted: Sequence[str], trackers: int) -> None:
    """Raise `IncompleteError` if trackers were omitted."""
    _warn([f"{reason}; the tracker is omitted" for reason in omitted])
    if omitted:
        raise IncompleteError(f"{len(omitted)} of {trackers} trackers could not be measured")


def _console() -> Console:
    return Console(width=None if sys.stdout.isatty() else _FILE_WIDTH)


def _trackers(results: Path, experiment: str) -> list[Path]:
    """The folders of trackers: the given one, or those in it, sorted by name."""
    if (results / experiment).is_dir():
        return [results]
    found = [path for path in sorted(results.iterdir()) if (path / experiment).is_dir()]
    if not found:
        raise ResultsError(
            f"{results}: neither it nor a folder in it holds "
            f"{experiment}/SEQUENCE/SEQUENCE_001.txt{_other_experiment(results)}"
        )
    return found


def _other_experiment(results: Path) -> str:
    """A hint to runs of another kind in a folder of results; empty without any."""
    folders = [results, *results.iterdir()]
    for name, option in _EXPERIMENT_OF_FOLDER.items():
        if any((folder / name).is_dir() for folder in folders):
            return f"; it has other runs: give --experiment {option}"
    return ""


def _warn(notes: Sequence[str]) -> None:
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


def _print_tables(reports: Sequence[TrackerReport], comparisons: Sequence[Comparison]) -> None:
    console = _console()
    console.print(scores_table(reports))
    if any(each.by_tag for each in reports):
        console.print(tags_table(reports))
    if comparisons:
        console.print(comparisons_table(comparisons))
