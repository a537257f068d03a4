"""`tune`: the numbers of `StabilizerConfig` that suit a tracker and its footage, by Optuna."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from ssiam.datasets import open_dataset
from ssiam.errors import MissingExtraError, SinkError, SsiamError, check_choice
from ssiam.evaluation.bench import run_all, tasks
from ssiam.evaluation.entries import Entry
from ssiam.evaluation.parameters import Parameter, configured, paper_values
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import TRACKERS

_NAME: Final = "ssiam"
_FILE: Final = "study.db"


class TuningError(SsiamError):
    """A search that cannot go on: its file is damaged or of another search, or runs fail."""


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
        ``study.db`` is damaged or of another search, or a run has no result.
    SinkError
        The folder cannot be written.
    """
    with _one_line_errors(search.out / _FILE):
        study = _opened(search)
        for number, done in enumerate(_complete(study), 1):
            yield _tried(number, done)
        while (count := len(_complete(study))) < trials:
            trial = _next(study, search, count)
            config = configured(trial.params)
            lost, overlap = _measured(search, config, jobs)
            trial.set_user_attr("lost", lost)
            trial.set_user_attr("overlap", overlap)
            tried = Tried(count + 1, config, lost, overlap)
            study.tell(trial, tried.cost)
            yield tried


def _opened(search: Search) -> Any:
    """The study in the search's folder, new or from earlier."""
    try:
        import optuna
    except ImportError as error:
        raise MissingExtraError("tuning needs optuna: pip install 'ssiam[bench]'") from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        search.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SinkError(f"{search.out}: cannot be made ({error.strerror or error})") from error
    path = search.out / _FILE
    study = optuna.create_study(storage=f"sqlite:///{path}", study_name=_NAME, load_if_exists=True)
    told = _described(search)
    if not study.user_attrs:
        study.set_user_attr("search", told)
    earlier = study.user_attrs["search"]
    if earlier != told:
        differing = ", ".join(name for name in told if earlier.get(name) != told[name])
        raise TuningError(f"{path}: is a search of other {differing}; give another --out")
    for trial in study.get_trials(states=[optuna.trial.TrialState.RUNNING]):
        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
    return study


def _described(search: Search) -> dict[str, Any]:
    """What makes a search the same one; JSON."""
    return {
        "trackers": list(search.trackers),
        "parameters": [str(each) for each in search.parameters],
        "sequences": list(open_dataset(search.dataset).sequences),
        "seed": search.seed,
    }


def _next(study: Any, search: Search, count: int) -> Any:
    """The next trial; its sampler is seeded anew, so that an interruption leaves no trace."""
    import optuna

    study.sampler = optuna.samplers.TPESampler(seed=search.seed + count)
    first = paper_values(search.parameters)
    waiting = study.get_trials(states=[optuna.trial.TrialState.WAITING])
    if count == 0 and first is not None and not waiting:
        study.enqueue_trial(first)
    return study.ask({each.name: _distribution(each) for each in search.parameters})


def _distribution(parameter: Parameter) -> Any:
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    if parameter.choices:
        return CategoricalDistribution(parameter.choices)
    if isinstance(getattr(StabilizerConfig(), parameter.name), int):
        return IntDistribution(int(parameter.low), int(parameter.high))
    return FloatDistribution(parameter.low, parameter.high, step=parameter.step)


def _measured(search: Search, config: StabilizerConfig, jobs: int) -> tuple[int, float]:
    """Lost targets and mean overlap of a config."""
    competitors = [
        Entry(check_choice("tracker", name, TRACKERS), config, search.weights.get(name))
        for name in search.trackers
    ]
    todo = tasks(competitors, open_dataset(search.dataset), search.dataset, search.out)
    for done in run_all(todo, jobs):
        if done.failed:
            raise TuningError(f"{done.label} on {done.sequence}: {done.failed}")
    # Told again, all from their files: these are rounded, and always come in the same order.
    told = list(run_all(todo))
    overlaps = [each.overlap for each in told if not math.isnan(each.overlap)]
    mean = math.fsum(overlaps) / len(overlaps) if overlaps else 0.0
    return sum(each.lost for each in told), mean


def _complete(study: Any) -> list[Any]:
    from optuna.trial import TrialState

    return list(study.get_trials(deepcopy=False, states=[TrialState.COMPLETE]))


def _tried(number: int, trial: Any) -> Tried:
    attributes = trial.user_attrs
    return Tried(number, configured(trial.params), attributes["lost"], attributes["overlap"])


@contextmanager
def _one_line_errors(path: Path) -> Iterator[None]:
    """Turns what Optuna and its database say into one line."""
    try:
        yield
    except SsiamError:
        raise
    except Exception as error:
        if type(error).__module__.partition(".")[0] not in ("optuna", "sqlalchemy"):
            raise
        raise TuningError(
            f"{path}: cannot be used ({str(error).splitlines()[0]}); if it is damaged, delete it: "
            "the runs beside it are kept"
        ) from error
