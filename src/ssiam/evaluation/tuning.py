"""`tune`: the numbers of `StabilizerConfig` that suit a tracker and its footage, by Optuna."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from ssiam.datasets import open_dataset
from ssiam.errors import check_choice
from ssiam.evaluation.bench import run_all, tasks
from ssiam.evaluation.entries import Entry
from ssiam.evaluation.parameters import Parameter, configured
from ssiam.evaluation.study import (
    TrialError,
    TuningError,
    complete_trials,
    next_trial,
    one_line_errors,
    open_study,
)
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import TRACKERS

_FILE: Final = "study.db"


@dataclass(frozen=True)
class Search:
    """What is searched, on what, and where it is kept.

    Attributes
    ----------
    dataset : Path
    trackers : tuple of str
    parameters : tuple of Parameter
    out : Path
        Folder of ``study.db`` and of the results of the runs, as `ssiam bench` keeps them.
    weights : mapping of str to Path
        By the tracker's name.
    seed : int
        The same search with the same seed tries the same values.
    """

    dataset: Path
    trackers: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    out: Path
    weights: Mapping[str, Path] = field(default_factory=dict)
    seed: int = 0


@dataclass(frozen=True)
class Tried:
    """A trial that is done.

    Attributes
    ----------
    number : int
        From 1.
    config : StabilizerConfig
    lost : int
        Targets lost in supervised runs of all trackers over all sequences.
    overlap : float
        Mean overlap: of each run the mean intersection over union of its tracked frames, and of
        these the mean; runs that have no tracked frame do not count, and if none has, it is 0.
    """

    number: int
    config: StabilizerConfig
    lost: int
    overlap: float

    @property
    def cost(self) -> float:
        """What is minimised: ``lost - overlap``.

        A target fewer always counts for more than any overlap, which is less than 1; where as
        many are lost, the larger overlap wins.
        """
        return self.lost - self.overlap


def tune(search: Search, trials: int, jobs: int = 1) -> Iterator[Tried]:
    """Search until `trials` trials are done, and tell of each, those of earlier calls first.

    The first trial has the paper's numbers, if the parameters allow them; the others are chosen
    by Optuna's TPE. An interrupted search goes on where it stopped, and ends as an undisturbed one
    would: the choice depends on the seed and the finished trials only, a trial that was under way
    is done again, and of its runs only those that had not ended. One process at a time may search
    in a folder.

    Parameters
    ----------
    search : Search
    trials : int
        Of all calls together.
    jobs : int
        Runs of a trial at a time.

    Raises
    ------
    MissingExtraError
        Optuna is not installed.
    TuningError
        ``study.db`` is damaged or of another search, or no run of a trial has a result.
    TrialError
        Some runs of a trial have no result. The others are kept.
    SinkError
        The folder cannot be written.
    """
    path = search.out / _FILE
    with one_line_errors(path):
        study = open_study(path, _described(search))
        for number, done in enumerate(complete_trials(study), 1):
            yield _tried(number, done)
        while (count := len(complete_trials(study))) < trials:
            trial = next_trial(study, search.parameters, search.seed)
            config = configured(trial.params)
            lost, overlap = _measured(search, config, jobs)
            trial.set_user_attr("lost", lost)
            trial.set_user_attr("overlap", overlap)
            tried = Tried(count + 1, config, lost, overlap)
            study.tell(trial, tried.cost)
            yield tried


def _described(search: Search) -> dict[str, Any]:
    """What makes a search the same one; JSON."""
    return {
        "trackers": list(search.trackers),
        "parameters": [str(each) for each in search.parameters],
        "sequences": list(open_dataset(search.dataset).sequences),
        "seed": search.seed,
    }


def _measured(search: Search, config: StabilizerConfig, jobs: int) -> tuple[int, float]:
    """Lost targets and mean overlap of a config."""
    competitors = [
        Entry(check_choice("tracker", name, TRACKERS), config, search.weights.get(name))
        for name in search.trackers
    ]
    todo = tasks(competitors, open_dataset(search.dataset), search.dataset, search.out)
    failed = [done for done in run_all(todo, jobs) if done.failed]
    if failed:
        first = failed[0]
        reason = f"{first.label} on {first.sequence}: {first.failed}"
        if len(failed) == len(todo):
            raise TuningError(reason)
        raise TrialError(
            f"{len(failed)} of the {len(todo)} runs of a trial have no result, which the search "
            f"cannot do without; they are tried again when the command is. The first: {reason}"
        )
    # Told again, all from their files: these are rounded, and always come in the same order.
    told = list(run_all(todo))
    overlaps = [each.overlap for each in told if not math.isnan(each.overlap)]
    mean = math.fsum(overlaps) / len(overlaps) if overlaps else 0.0
    return sum(each.lost for each in told), mean


def _tried(number: int, trial: Any) -> Tried:
    attributes = trial.user_attrs
    return Tried(number, configured(trial.params), attributes["lost"], attributes["overlap"])
