"""`TrackedSequence`: a sequence with a tracker's runs on it, read from a folder of results."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ssiam.datasets.sequence import VideoSequence
from ssiam.errors import ArgumentError
from ssiam.evaluation.layouts import Experiment, read_vot, repetitions, vot_path
from ssiam.evaluation.lines import ResultsError
from ssiam.evaluation.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class TrackedSequence:
    """A sequence and at least one run of a tracker, none longer than the sequence's truth."""

    sequence: VideoSequence
    runs: tuple[Trajectory, ...]

    @property
    def name(self) -> str:
        """The sequence's."""
        return self.sequence.name

    @property
    def size_wh(self) -> tuple[int, int]:
        """Width and height of the frames, pixels; `ArgumentError` if the dataset is silent."""
        if self.sequence.size_wh is None:
            raise ArgumentError(
                f"sequence {self.name}: the dataset does not tell the size of its frames, "
                "and overlaps end at their border; add width and height to it"
            )
        return self.sequence.size_wh

    @property
    def lost(self) -> float:
        """How often the target was lost, the mean of all runs."""
        return sum(len(run.failures) for run in self.runs) / len(self.runs)


@dataclass(frozen=True, eq=False)
class TrackerResults:
    """What a tracker's folder holds of a dataset.

    `notes` are lines for people: what was missing or short, and what was done about it.
    """

    name: str
    tracked: tuple[TrackedSequence, ...]
    notes: tuple[str, ...]


def read_results(
    folder: Path, sequences: Iterable[VideoSequence], experiment: Experiment = "baseline"
) -> TrackerResults:
    """The supervised runs of a tracker in ``folder/baseline/<sequence>/<sequence>_001.txt``.

    Sequences without results are left out. Of a file that is shorter than its sequence the frames
    that it has are measured, of one that is longer as many as the sequence has.

    Raises
    ------
    ResultsError
        A file is damaged, or the folder holds results of none of the sequences.
    """
    tracked, notes = [], []
    for sequence in sequences:
        paths = repetitions(vot_path(folder, sequence.name, experiment=experiment))
        if not paths:
            notes.append(f"{folder}: no results for sequence {sequence.name}; it is left out")
            continue
        runs = [_fitted(path, len(sequence.truth), notes) for path in paths]
        tracked.append(TrackedSequence(sequence, tuple(runs)))
    if not tracked:
        example = vot_path(Path(), "<sequence>", experiment=experiment)
        raise ResultsError(f"{folder}: holds no results of the dataset; they lie in {example}")
    return TrackerResults(folder.name or folder.resolve().name, tuple(tracked), tuple(notes))


def _fitted(path: Path, length: int, notes: list[str]) -> Trajectory:
    run = read_vot(path)
    if len(run) == 0:
        raise ResultsError(f"{path}: is empty; delete it to leave the sequence out")
    if len(run.failures) > len(run.initializations):
        raise ResultsError(f"{path}: has more failures (2) than starts (1); is it cut off?")
    if len(run) != length:
        measured = min(len(run), length)
        notes.append(
            f"{path}: {len(run)} lines for {length} frames; the first {measured} are measured"
        )
    return run.first(length)
