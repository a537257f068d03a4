"""One-pass results, in whichever of the usual layouts they lie, and their measures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from ssiam.datasets import VideoSequence
from ssiam.evaluation.layouts import (
    got10k_path,
    otb_path,
    read_boxes,
    read_vot,
    repetitions,
    vot_path,
)
from ssiam.evaluation.lines import ResultsError
from ssiam.evaluation.raster import Floats
from ssiam.evaluation.regions import upright
from ssiam.evaluation.success import average_overlap, got10k_overlaps, mean_success, success
from ssiam.evaluation.trajectory import Status, Trajectory

_FIGURES = ("success", "precision", "normalised_precision", "ao", "sr50", "sr75", "sequences")
_ENDLESS = (10**6, 10**6)  # px; stands for the size of frames that is not told


@dataclass(frozen=True)
class OnePassReport:
    """How well a tracker holds its targets without being started again.

    Attributes
    ----------
    name : str
    success, precision, normalised_precision : float
        Of OTB and LaSOT: area under the success curve, share of the frames whose centre is within
        20 pixels, and within .2 of the target's size; means over the sequences.
    ao, sr50, sr75 : float
        Of GOT-10k: mean overlap, and shares of frames above .5 and .75; over all frames.
    sequences : int
    notes : tuple of str
        Lines for people: what was missing or short, and what was done about it.
    """

    name: str
    success: float
    precision: float
    normalised_precision: float
    ao: float
    sr50: float
    sr75: float
    sequences: int
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """All figures; None for what cannot be told."""
        figures = {name: getattr(self, name) for name in _FIGURES}
        return {name: None if math.isnan(value) else value for name, value in figures.items()}


def one_pass(folder: Path, sequences: Iterable[VideoSequence]) -> OnePassReport:
    """Measure the one-pass runs of a tracker.

    They may lie in ``ope/<sequence>.txt`` or ``<sequence>.txt`` (OTB, LaSOT: 1-based boxes), in
    ``<sequence>/<sequence>_001.txt`` (GOT-10k: 0-based boxes) or in
    ``unsupervised/<sequence>/<sequence>_001.txt`` (VOT). Sequences without results are left out.

    Raises
    ------
    ResultsError
        A file is damaged, or the folder holds results of none of the sequences.
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
                    "what is missing counts as missed"
                )
            boxes = _boxes(run, truth)
            curves.append(success(boxes, truth))
            overlaps.append(got10k_overlaps(boxes, truth, sequence.size_wh or _ENDLESS))
    if not curves:
        raise ResultsError(f"{folder}: holds no one-pass results of the dataset")
    mean, average = mean_success(curves), average_overlap(overlaps)
    return OnePassReport(
        folder.resolve().name,
        mean.auc,
        mean.precision,
        mean.normalised_precision,
        average.ao,
        average.sr50,
        average.sr75,
        len(curves),
        tuple(notes),
    )


def one_pass_table(reports: Sequence[OnePassReport]) -> Table:
    """A row for each tracker."""
    table = Table("tracker", *_FIGURES)
    for each in reports:
        figures = each.as_dict().values()
        cells = (f"{value:.3f}" if isinstance(value, float) else str(value) for value in figures)
        table.add_row(each.name, *cells)
    return table


def holds_one_pass(folder: Path) -> bool:
    """Whether a folder looks like one of a tracker's one-pass results."""
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
    """Boxes (N, 4) of a run, as many as the truth has; a start counts as the truth itself."""
    count = min(len(run), len(truth))
    boxes = np.full((len(truth), 4), np.nan)
    started = np.flatnonzero(run.status[:count] == Status.INITIALIZED)
    tracked = np.flatnonzero(run.status[:count] == Status.TRACKED)
    boxes[tracked] = upright(run.regions[tracked])
    boxes[started] = truth[started]
    return boxes
