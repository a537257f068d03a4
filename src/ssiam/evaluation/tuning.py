"""`tune`: search the settings of `StabilizerConfig` for a tracker and its footage with Optuna.

The search is stored in a file. After an interruption it is resumed, with the same result.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from ssiam.datasets import open_dataset
from ssiam.errors import IncompleteError, MissingExtraError, SsiamError, check_choice
from ssiam.evaluation.parameters import (
    Parameter,
    SearchedMethod,
    check_method,
    default_values,
    is_whole,
    searched_config,
)
from ssiam.evaluation.runs.bench import run_all, tasks
from ssiam.evaluation.runs.entries import DEFAULT_OPTIONS, Entry, changed_runtime, options_for
from ssiam.evaluation.runs.identity import Identity
from ssiam.outputs import make_folder
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import TRACKERS

_FILE: Final = "study.db"
_NAME: Final = "ssiam"
_PACKAGES: Final = ("optuna", "sqlalchemy")  # their exceptions become `TuningError`
# What identifies a search, for studies of earlier versions, which do not say it.
_EARLIER: Final[dict[str, Any]] = {"runtime": {}, "weights": {}, "stabilize": "paper"}


class TuningError(SsiamError):
    """The search cannot continue: its file is damaged or of another search, or its runs failed."""


class TrialError(TuningError, IncompleteError):
    """Some runs of a trial failed; the results of the others are kept."""


@dataclass(frozen=True)
class Search:
    """A search: its data, trackers and parameters, and its folder.

    Attributes
    ----------
    dataset : Path
    trackers : tuple of str
    parameters : tuple of Parameter
    out : Path
        Folder of ``study.db`` and of the result files, in the layout of ``ssiam bench``.
    weights : mapping of str to Path
        By the name of the tracker.
    seed : int
        A search with the same seed tries the same values.
    options : RuntimeOptions
        How the networks run, and the threads of each run.
    stabilize : {"predict", "paper", "literal"}
        The method whose settings are searched.

    Raises
    ------
    ArgumentError
        The method does not read one of the parameters.
    """

    dataset: Path
    trackers: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    out: Path
    weights: Mapping[str, Path] = field(default_factory=dict)
    seed: int = 0
    options: RuntimeOptions = DEFAULT_OPTIONS
    stabilize: SearchedMethod = "predict"

    def __post_init__(self) -> None:
        check_method(self.parameters, self.stabilize)

    @property
    def sequences(self) -> tuple[str, ...]:
        """Names of the sequences that choose; they must not report the result."""
        return tuple(open_dataset(self.dataset).sequences)


@dataclass(frozen=True)
class FinishedTrial:
    """The result of a trial.

    Attributes
    ----------
    number : int
        From 1.
    config : StabilizerConfig
    lost : int
        Lost targets in the supervised runs of all trackers over all sequences.
    overlap : float
        Mean over the runs of the mean intersection over union of their tracked frames; runs
        without tracked frames do not count, and it is 0 if there are no others.
    """

    number: int
    config: StabilizerConfig
    lost: int
    overlap: float

    @property
    def cost(self) -> float:
        """The minimized cost, ``lost - overlap``.

        The overlap is at most 1, so it only decides between trials with equally many lost targets.
        """
        return self.lost - self.overlap


def tune(search: Search, trials: int, jobs: int = 1) -> Iterator[FinishedTrial]:
    """Search until `trials` trials are finished, and yield each, those of earlier calls first.

    The first trial uses the method's defaults (for "paper" the paper's values) if the parameters
    allow them; Optuna's TPE chooses the others. An interrupted search resumes where it stopped, and
    gives the same result as an uninterrupted one, because the choice depends only on the seed and
    the finished trials. An interrupted trial is repeated, except its finished runs. Only one
    process at a time may search in a folder.

    Parameters
    ----------
    search : Search
    trials : int
        Number of trials, including those of earlier calls.
    jobs : int
        Runs of a trial in parallel.

    Raises
    ------
    MissingExtraError
        Optuna is not installed.
    TuningError
        ``study.db`` is damaged or belongs to another search, or all runs of a trial failed.
    TrialError
        Some runs of a trial failed. The results of the others are kept.
    SinkError
        The folder cannot be written.
    """
    path = search.out / _FILE
    with _one_line_errors(path):
        study = _open_study(path, _identity(search))
        for number, done in enumerate(_complete_trials(study), 1):
            yield _finished(number, done, search.stabilize)
        while (count := len(_complete_trials(study))) < trials:
            trial = _next_trial(study, search)
            config = searched_config(search.stabilize, trial.params)
            lost, overlap = _measured(search, config, jobs)
            trial.set_user_attr("lost", lost)
            trial.set_user_attr("overlap", overlap)
            finished = FinishedTrial(count + 1, config, lost, overlap)
            study.tell(trial, finished.cost)
            yield finished


def _identity(search: Search) -> dict[str, Any]:
    """The values that identify a search; JSON can hold them."""
    return {
        "trackers": list(search.trackers),
        "parameters": [str(each) for each in search.parameters],
        "sequences": list(search.sequences),
        "seed": search.seed,
        "runtime": changed_runtime(search.options),
        "weights": _weights(search),
        "stabilize": search.stabilize,
    }


def _weights(search: Search) -> dict[str, str]:
    """SHA-256 of the weights by tracker, for those that have any."""
    entries = _entries(search, StabilizerConfig("off"))
    digests = {entry.tracker: Identity.of(entry).weights_sha256 for entry in entries}
    return {name: digest for name, digest in digests.items() if digest is not None}


def _entries(search: Search, config: StabilizerConfig) -> list[Entry]:
    """The trackers of a search with a configuration."""
    return [
        Entry(
            check_choice("tracker", name, TRACKERS),
            config,
            search.weights.get(name),
            options_for(name, search.options),
        )
        for name in search.trackers
    ]


def _measured(search: Search, config: StabilizerConfig, jobs: int) -> tuple[int, float]:
    """Lost targets and mean overlap of a configuration."""
    todo = tasks(_entries(search, config), open_dataset(search.dataset), search.dataset, search.out)
    failed = [result for result in run_all(todo, jobs) if result.failed]
    if failed:
        first = failed[0]
        reason = f"{first.label} on {first.sequence}: {first.failed}"
        if len(failed) == len(todo):
            raise TuningError(reason)
        raise TrialError(
            f"{len(failed)} of the {len(todo)} runs of a trial failed, and the search needs all of "
            f"them; run the command again to retry them. The first: {reason}"
        )
    # Read from the files, so that rounding and order do not depend on an interruption.
    results = list(run_all(todo))
    overlaps = [each.overlap for each in results if not math.isnan(each.overlap)]
    mean = math.fsum(overlaps) / len(overlaps) if overlaps else 0.0
    return sum(each.lost for each in results), mean


def _finished(number: int, trial: Any, method: SearchedMethod) -> FinishedTrial:
    attributes = trial.user_attrs
    return FinishedTrial(
        number,
        searched_config(method, trial.params),
        attributes["lost"],
        attributes["overlap"],
    )


def _open_study(path: Path, search: Mapping[str, Any]) -> Any:
    """Open or create the Optuna study of a search; unfinished trials become failed ones.

    Raises
    ------
    MissingExtraError
        Optuna is not installed.
    TuningError
        The file belongs to another search.
    SinkError
        Its folder cannot be created.
    """
    try:
        import optuna
    except ImportError as error:
        raise MissingExtraError("tuning needs optuna: pip install 'ssiam[bench]'") from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    make_folder(path.parent)
    study = optuna.create_study(storage=f"sqlite:///{path}", study_name=_NAME, load_if_exists=True)
    if not study.user_attrs:
        study.set_user_attr("search", dict(search))
    earlier = study.user_attrs["search"]
    differing = [name for name in search if earlier.get(name, _EARLIER.get(name)) != search[name]]
    if differing:
        raise TuningError(
            f"{path}: belongs to a search with other {' and '.join(differing)}; give another --out"
        )
    for trial in study.get_trials(states=[optuna.trial.TrialState.RUNNING]):
        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
    return study


def _complete_trials(study: Any) -> list[Any]:
    """The finished trials, in order."""
    from optuna.trial import TrialState

    return list(study.get_trials(deepcopy=False, states=[TrialState.COMPLETE]))


def _next_trial(study: Any, search: Search) -> Any:
    """A trial with the default values if it is the first one, else with values chosen by TPE.

    The sampler is seeded by the number of finished trials, so that an interruption does not change
    the trials that follow.
    """
    import optuna

    count = len(_complete_trials(study))
    study.sampler = optuna.samplers.TPESampler(seed=search.seed + count)
    first = default_values(search.stabilize, search.parameters)
    waiting = study.get_trials(states=[optuna.trial.TrialState.WAITING])
    if count == 0 and first is not None and not waiting:
        study.enqueue_trial(first)
    return study.ask({each.name: _distribution(each) for each in search.parameters})


@contextmanager
def _one_line_errors(path: Path) -> Iterator[None]:
    """Turn exceptions of Optuna and its database into a `TuningError`."""
    try:
        yield
    except Exception as error:
        if type(error).__module__.partition(".")[0] not in _PACKAGES:
            raise
        raise TuningError(
            f"{path}: cannot be used ({str(error).splitlines()[0]}); if it is damaged, delete it: "
            "the result files are kept"
        ) from error


def _distribution(parameter: Parameter) -> Any:
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    if parameter.choices:
        return CategoricalDistribution(parameter.choices)
    if is_whole(parameter.name):
        return IntDistribution(int(parameter.low), int(parameter.high))
    return FloatDistribution(parameter.low, parameter.high, step=parameter.step)
