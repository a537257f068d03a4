"""`Summary`: what the results of one benchmark entry are worth on one dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ssiam.datasets import VideoSequence
from ssiam.evaluation.eao import mean_or_nan
from ssiam.evaluation.raster import Floats
from ssiam.evaluation.regions import upright
from ssiam.evaluation.scores import Scores
from ssiam.evaluation.success import Success, mean_success, success
from ssiam.evaluation.tracked import TrackedSequence
from ssiam.evaluation.trajectory import Status, Trajectory
from ssiam.geometry import iou
from ssiam.stabilize import StabilizerConfig


@dataclass(frozen=True, eq=False)
class Summary:
    """The runs of one entry on one dataset, and what they measure.

    Attributes
    ----------
    label : str
        Name of its folder.
    tracker : str
    config : StabilizerConfig or None
        None for results of other programs, whose folders do not tell.
    supervised, one_pass : mapping of str to TrackedSequence
        By sequence; those that are not there are left out.
    fps : float
        Frames a second over all supervised runs, else over the one-pass ones; nan if not told.
    scores : Scores or None
        pysot's conventions; None where the dataset is no year of VOT.
    """

    label: str
    tracker: str
    config: StabilizerConfig | None
    supervised: Mapping[str, TrackedSequence]
    one_pass: Mapping[str, TrackedSequence]
    fps: float
    scores: Scores | None

    @cached_property
    def lost(self) -> dict[str, float]:
        """Targets lost in each sequence."""
        return {name: each.lost for name, each in self.supervised.items()}

    @cached_property
    def overlaps(self) -> dict[str, float]:
        """Mean overlap of the tracked frames of each sequence; nan if the truth is not told."""
        return {
            name: mean_or_nan(np.concatenate([tracked_overlaps(each, run) for run in each.runs]))
            for name, each in self.supervised.items()
        }

    @cached_property
    def success(self) -> Success:
        """Success of the one-pass runs, the mean of the sequences."""
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
        Of VOT, if the dataset is one whose EAO is defined.
    sequences : mapping of str to VideoSequence
    entries : list of Summary
        By tracker, and of each the tracker alone first.
    notes : list of str
        A line for whatever is missing or damaged, and was left out.
    """

    dataset: str
    year: int | None
    sequences: Mapping[str, VideoSequence]
    entries: Sequence[Summary]
    notes: Sequence[str]

    def find(self, tracker: str, config: StabilizerConfig) -> Summary | None:
        """The entry of a tracker with a way of steadying; None if it was not run."""
        wanted = tracker, config
        return next((each for each in self.entries if (each.tracker, each.config) == wanted), None)


def tracked_overlaps(tracked: TrackedSequence, run: Trajectory) -> Floats:
    """Intersection over union of a run's tracked frames with the truth, nan where it is unknown."""
    frames = np.flatnonzero(run.status == Status.TRACKED)
    return iou(upright(run.regions[frames]), upright(tracked.sequence.truth[frames]))


def success_of(tracked: TrackedSequence, run: Trajectory) -> Success:
    """Success of a run; the frames of its starts, and those skipped after a loss, do not count.

    A lost target is a miss. Of a one-pass run the first frame counts, as in OTB: there the box
    is the truth.
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
