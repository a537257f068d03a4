"""`summarize`: read a folder of ``ssiam bench`` results and measure each entry."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from ssiam.datasets import Dataset, VideoSequence
from ssiam.datasets.sequence import with_size
from ssiam.errors import SsiamError, check_choice
from ssiam.evaluation.measures import pysot
from ssiam.evaluation.measures.eao import INTERVALS, Scores, known_year, mean_or_nan
from ssiam.evaluation.measures.regions import Floats, upright
from ssiam.evaluation.measures.success import Success, mean_success, success
from ssiam.evaluation.measures.trajectory import Status, TrackedSequence, Trajectory
from ssiam.evaluation.runs.entries import VARIANT_KEYS
from ssiam.evaluation.runs.result_files import (
    Experiment,
    ResultsError,
    file_name,
    read_lines,
    read_results,
    repetitions,
    vot_path,
)
from ssiam.geometry import iou
from ssiam.stabilize import METHODS, StabilizerConfig

_EXPERIMENTS: Final[tuple[Experiment, ...]] = ("baseline", "unsupervised")
_MAX_NAMES: Final = 4  # in a note
_SETTINGS: Final = r"-(?=[a-z_0-9]+=)"  # before each setting of a label
_BOOLS: Final = {"True": True, "False": False}
_PARSERS: Final[dict[type, Callable[[str], Any]]] = {  # by type of an option
    int: int,
    float: float,
    bool: _BOOLS.__getitem__,
}


@dataclass(frozen=True, eq=False)
class Summary:
    """Runs and measures of one benchmark entry on one dataset.

    Attributes
    ----------
    label : str
        Name of the results folder.
    tracker : str
        With the variant of the run (runtime, weights, ...) if the tracker has several.
    config : StabilizerConfig or None
        None for results of other programs, whose folder names do not contain it.
    supervised, one_pass : mapping of str to TrackedSequence
        By sequence; missing ones are left out.
    fps : float
        Frames per second over all supervised runs, or else one-pass runs; nan if unknown.
    scores : Scores or None
        Of the supervised runs, by pysot's conventions; EAO is nan if the dataset is not a year of
        VOT. None without such runs or without the size of the frames.
    eao_curve : (L,) float64 or None
        Expected overlap by fragment length (`pysot.eao_curve`); None where `scores` is.
    """

    label: str
    tracker: str
    config: StabilizerConfig | None
    supervised: Mapping[str, TrackedSequence]
    one_pass: Mapping[str, TrackedSequence]
    fps: float
    scores: Scores | None
    eao_curve: Floats | None

    @cached_property
    def lost(self) -> dict[str, float]:
        """Lost targets of each sequence."""
        return {name: each.lost for name, each in self.supervised.items()}

    @cached_property
    def overlaps(self) -> dict[str, float]:
        """Mean overlap of the tracked frames of each sequence; nan without ground truth."""
        return {
            name: mean_or_nan(np.concatenate([_tracked_overlaps(each, run) for run in each.runs]))
            for name, each in self.supervised.items()
        }

    @cached_property
    def success(self) -> Success:
        """Success of the one-pass runs, the mean over the sequences."""
        return mean_success(
            [success_of(each, run) for each in self.one_pass.values() for run in each.runs]
        )


@dataclass(frozen=True, eq=False)
class Summaries:
    """All results of a folder on one dataset.

    Attributes
    ----------
    dataset : str
    year : int or None
        VOT year, if the dataset is one with a defined EAO.
    sequences : mapping of str to VideoSequence
    entries : list of Summary
        Sorted by tracker, with the tracker alone first.
    notes : list of str
        A line for each missing or damaged result that was left out.
    """

    dataset: str
    year: int | None
    sequences: Mapping[str, VideoSequence]
    entries: Sequence[Summary]
    notes: Sequence[str]

    def find(self, tracker: str, config: StabilizerConfig) -> Summary | None:
        """The entry of a tracker with a configuration; None if it was not run."""
        wanted = tracker, config
        return next((each for each in self.entries if (each.tracker, each.config) == wanted), None)


def _tracked_overlaps(tracked: TrackedSequence, run: Trajectory) -> Floats:
    """Intersection over union of a run's tracked frames; nan without ground truth."""
    frames = np.flatnonzero(run.status == Status.TRACKED)
    return iou(upright(run.regions[frames]), upright(tracked.sequence.truth[frames]))


def success_of(tracked: TrackedSequence, run: Trajectory) -> Success:
    """Success of a run, without start frames and frames skipped after a loss.

    The frame of a loss counts as a miss. In a one-pass run the first frame counts with the true
    box, as in OTB.
    """
    truth = upright(tracked.sequence.truth[: len(run)])
    boxes = upright(run.regions)
    starts = run.initializations
    if len(starts) == 1 and not len(run.failures):
        boxes[starts] = truth[starts]
        truth[: starts[0]] = np.nan
    else:
        truth[np.isin(run.status, (Status.SKIPPED, Status.INITIALIZED))] = np.nan
    return success(boxes, truth)


def summarize(results: Path, dataset: Dataset) -> Summaries:
    """Read and measure all results of a dataset in a folder of ``ssiam bench``.

    Parameters
    ----------
    results : Path
        With ``<label>/baseline/<sequence>/<sequence>_001.txt`` and
        ``<label>/times/baseline/<sequence>.txt``; one-pass runs have ``unsupervised`` in place
        of ``baseline``.
    dataset : Dataset

    Raises
    ------
    ResultsError
        The folder contains no results.
    DatasetError
        The dataset is damaged.
    """
    folders = _folders(results)
    year = known_year(dataset.name)
    notes: list[str] = []
    sequences = {name: _with_size(each, notes) for name, each in dataset.sequences.items()}
    names = _tracker_names(folders)
    measured = (_summary(each, names[each], sequences, year, notes) for each in folders)
    entries = sorted(measured, key=_sort_key)
    found = [each for each in entries if each.supervised or each.one_pass]
    without_supervised = [each.label for each in found if not each.supervised]
    without_one_pass = [each.label for each in found if year is None and not each.one_pass]
    for kind, protocol, labels in (
        ("supervised", "vot", without_supervised),
        ("one-pass", "ope", without_one_pass),
    ):
        if labels:
            missing = f"no {kind} runs of {_listed(labels)}"
            notes.append(f"{dataset.name}: {missing} (ssiam bench ... --protocol {protocol})")
    return Summaries(dataset.name, year, sequences, found, notes)


def parse_label(label: str) -> tuple[str, StabilizerConfig] | None:
    """Tracker and configuration of an `Entry.label`; None if the text is not such a label.

    Runtime options and weights in the label are ignored; `parse_variant` returns them.
    """
    head, *settings = re.split(_SETTINGS, label)
    changes = [each for each in settings if each.partition("=")[0] not in VARIANT_KEYS]
    tracker, _, method = head.rpartition("-")
    options = StabilizerConfig().options()
    types = {name: _PARSERS.get(type(value), str) for name, value in options.items()}
    values: dict[str, Any] = {}
    try:
        for change in changes:
            name, _, value = change.partition("=")
            values[name] = types[name](value)
        config = StabilizerConfig(check_choice("stabilize", method, METHODS)).with_options(**values)
        return (tracker, config) if tracker else None
    except (KeyError, ValueError):
        return None


def parse_variant(label: str) -> str:
    """Runtime options and weights in a label, such as ``runtime=torch, threads=4``; often empty."""
    _, *settings = re.split(_SETTINGS, label)
    return ", ".join(each for each in settings if each.partition("=")[0] in VARIANT_KEYS)


def _tracker_names(folders: Iterable[Path]) -> dict[Path, str]:
    """Name of the tracker of each folder, with the variant for trackers that have several."""
    parsed = {folder: parse_label(folder.name) for folder in folders}
    variants: dict[str, set[str]] = {}
    for folder, found in parsed.items():
        if found is not None:
            variants.setdefault(found[0], set()).add(parse_variant(folder.name))
    names = {}
    for folder, found in parsed.items():
        name = folder.name if found is None else found[0]
        variant = parse_variant(folder.name)
        several = found is not None and variant and len(variants[name]) > 1
        names[folder] = f"{name} ({variant})" if several else name
    return names


def _sort_key(summary: Summary) -> tuple[str, int, str]:
    method = METHODS.index(summary.config.stabilize) if summary.config else 0
    return summary.tracker, method, summary.label


def _folders(results: Path) -> list[Path]:
    if not results.is_dir():
        raise ResultsError(f"{results}: no such folder; give --out of ssiam bench")
    found = [
        folder
        for folder in sorted(results.iterdir())
        if any((folder / experiment).is_dir() for experiment in _EXPERIMENTS)
    ]
    if not found:
        raise ResultsError(
            f"{results}: no subfolder with baseline/SEQUENCE/SEQUENCE_001.txt; "
            "give --out of ssiam bench"
        )
    return found


def _summary(
    folder: Path,
    tracker: str,
    sequences: Mapping[str, VideoSequence],
    year: int | None,
    notes: list[str],
) -> Summary:
    _, config = parse_label(folder.name) or ("", None)
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
        *_scores(supervised.values(), year),
    )


def _runs(
    folder: Path, sequences: Mapping[str, VideoSequence], experiment: Experiment, notes: list[str]
) -> dict[str, TrackedSequence]:
    """All undamaged runs; a note for each of the others, unless there are no runs at all."""
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
    """Frames per second over all sequences; frames with a time of 0 were skipped."""
    frames, seconds, missing = 0, 0.0, []
    for name in runs:
        path = folder / f"{file_name(name)}.txt"
        if not path.exists():
            missing.append(name)
            continue
        try:
            times = [values[0] for _, values in read_lines(path) if values[0] > 0]
        except ResultsError as error:
            notes.append(f"{error}; its times are left out")
            continue
        frames, seconds = frames + len(times), seconds + sum(times)
    if missing:
        notes.append(f"{folder}: no times of {_listed(missing)}")
    return frames / seconds if seconds else float("nan")


def _scores(
    runs: Iterable[TrackedSequence], year: int | None
) -> tuple[Scores, Floats] | tuple[None, None]:
    """A, R and EAO, and the curve of EAO; None without runs, or if a frame size is unknown."""
    tracked = list(runs)
    if not tracked or any(each.sequence.size_wh is None for each in tracked):
        return None, None
    measured = [pysot.measure(each) for each in tracked]
    interval = None if year is None else INTERVALS[year]
    return pysot.scores(measured, interval), pysot.eao_curve(measured)


def _with_size(sequence: VideoSequence, notes: list[str]) -> VideoSequence:
    """The sequence with its frame size, which VOT's overlaps need, read from its first image."""
    if sequence.size_wh is not None:
        return sequence
    try:
        return with_size(sequence)
    except SsiamError as error:
        notes.append(f"{error}; no A, R and EAO without the frame size")
        return sequence


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MAX_NAMES} more" if len(names) > _MAX_NAMES else ""
    return ", ".join(names[:_MAX_NAMES]) + more
