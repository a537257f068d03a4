"""Reads what `ssiam bench` has left in its folder, as far as it is there and whole."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from ssiam.datasets import Dataset, VideoSequence
from ssiam.errors import SsiamError, check_choice
from ssiam.evaluation import pysot
from ssiam.evaluation.eao import INTERVALS, known_year
from ssiam.evaluation.layouts import Experiment, file_name, repetitions, vot_path
from ssiam.evaluation.lines import ResultsError, read_lines
from ssiam.evaluation.scores import Scores
from ssiam.evaluation.summaries import Summaries, Summary
from ssiam.evaluation.tracked import TrackedSequence, read_results
from ssiam.stabilize import METHODS, StabilizerConfig

_EXPERIMENTS: Final[tuple[Experiment, ...]] = ("baseline", "unsupervised")
_LISTED: Final = 4  # names in a note
_READ: Final = {int: int, float: float}  # by the type of an option


def summarize(results: Path, dataset: Dataset) -> Summaries:
    """Read everything that a folder of bench results holds of a dataset.

    Parameters
    ----------
    results : Path
        Holds ``<label>/baseline/<sequence>/<sequence>_001.txt`` and
        ``<label>/times/baseline/<sequence>.txt``; one-pass runs have ``unsupervised`` in place
        of ``baseline``.
    dataset : Dataset

    Raises
    ------
    ResultsError
        There is no folder of results in it.
    DatasetError
        The dataset is damaged.
    """
    folders = _folders(results)
    year = known_year(dataset.name)
    notes: list[str] = []
    sequences = {name: _sized(each, year, notes) for name, each in dataset.sequences.items()}
    entries = sorted((_summary(each, sequences, year, notes) for each in folders), key=_place)
    found = [each for each in entries if each.supervised or each.one_pass]
    unsupervised = [each.label for each in found if not each.supervised]
    no_pass = [each.label for each in found if year is None and not each.one_pass]
    for kind, protocol, labels in (
        ("supervised", "vot", unsupervised),
        ("one-pass", "ope", no_pass),
    ):
        if labels:
            which = f"no {kind} runs of {_listed(labels)}"
            notes.append(f"{dataset.name}: {which} (ssiam bench ... --protocol {protocol})")
    return Summaries(dataset.name, year, sequences, found, notes)


def parse_label(label: str) -> tuple[str, StabilizerConfig] | None:
    """Tracker and config of an `Entry.label`; None if it is none."""
    head, *changes = re.split(r"-(?=[a-z_0-9]+=)", label)
    tracker, _, method = head.rpartition("-")
    options = StabilizerConfig().options()
    types = {name: _READ.get(type(value), str) for name, value in options.items()}
    values: dict[str, Any] = {}
    try:
        for change in changes:
            name, _, value = change.partition("=")
            values[name] = types[name](value)
        config = StabilizerConfig(check_choice("stabilize", method, METHODS)).with_options(**values)
        return (tracker, config) if tracker else None
    except (KeyError, ValueError):
        return None


def _place(summary: Summary) -> tuple[str, int, str]:
    method = METHODS.index(summary.config.stabilize) if summary.config else 0
    return summary.tracker, method, summary.label


def _folders(results: Path) -> list[Path]:
    if not results.is_dir():
        raise ResultsError(f"{results}: there is no such folder; give --out of ssiam bench")
    found = [
        folder
        for folder in sorted(results.iterdir())
        if any((folder / experiment).is_dir() for experiment in _EXPERIMENTS)
    ]
    if not found:
        raise ResultsError(
            f"{results}: no folder in it holds baseline/SEQUENCE/SEQUENCE_001.txt; "
            "give --out of ssiam bench"
        )
    return found


def _summary(
    folder: Path, sequences: Mapping[str, VideoSequence], year: int | None, notes: list[str]
) -> Summary:
    tracker, config = parse_label(folder.name) or (folder.name, None)
    supervised = _runs(folder, sequences, "baseline", notes)
    one_pass = _runs(folder, sequences, "unsupervised", notes)
    experiment: Experiment = "baseline" if supervised else "unsupervised"
    return Summary(
        folder.name,
        tracker,
        config,
        supervised,
        one_pass,
        _fps(folder / "times" / experiment, supervised or one_pass, notes),
        _scores(supervised.values(), year),
    )


def _runs(
    folder: Path, sequences: Mapping[str, VideoSequence], experiment: Experiment, notes: list[str]
) -> dict[str, TrackedSequence]:
    """The runs that are there and whole; a note for the rest, unless there is nothing at all."""
    found, missing = {}, []
    for name, sequence in sequences.items():
        if not repetitions(vot_path(folder, name, experiment=experiment)):
            missing.append(name)
            continue
        try:
            results = read_results(folder, [sequence], experiment)
        except ResultsError as error:
            notes.append(f"{error}; it is left out")
            continue
        found[name] = results.tracked[0]
        notes += results.notes
    if found and missing:
        notes.append(
            f"{folder.name}: no {experiment} results of {len(missing)} of {len(sequences)} "
            f"sequences: {_listed(missing)}"
        )
    return found


def _fps(folder: Path, runs: Iterable[str], notes: list[str]) -> float:
    """Frames a second over all sequences; frames that took no time at all were skipped."""
    frames, seconds, untold = 0, 0.0, []
    for name in runs:
        path = folder / f"{file_name(name)}.txt"
        if not path.exists():
            untold.append(name)
            continue
        try:
            times = [values[0] for _, values in read_lines(path) if values[0] > 0]
        except ResultsError as error:
            notes.append(f"{error}; its times are left out")
            continue
        frames, seconds = frames + len(times), seconds + sum(times)
    if untold:
        notes.append(f"{folder}: no times of {_listed(untold)}")
    return frames / seconds if seconds else float("nan")


def _scores(runs: Iterable[TrackedSequence], year: int | None) -> Scores | None:
    """A, R and EAO; None without a year, or where the size of the frames is not known."""
    tracked = list(runs)
    if year is None or not tracked or any(each.sequence.size_wh is None for each in tracked):
        return None
    return pysot.scores([pysot.measured(each) for each in tracked], INTERVALS[year])


def _sized(sequence: VideoSequence, year: int | None, notes: list[str]) -> VideoSequence:
    """The sequence with the size of its frames, which overlaps in VOT end at."""
    if year is None or sequence.size_wh is not None:
        return sequence
    try:
        height, width = next(sequence.images()).shape[:2]
    except SsiamError as error:
        notes.append(f"{error}; without the size of its frames there is no A, R and EAO")
        return sequence
    return replace(sequence, size_wh=(width, height))


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more
