"""Optuna's study in a file: opened again after an interruption as if there had been none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from ssiam.errors import IncompleteError, MissingExtraError, SsiamError
from ssiam.evaluation.parameters import Parameter, is_whole, paper_values
from ssiam.outputs import make_folder

_NAME: Final = "ssiam"
_PACKAGES: Final = ("optuna", "sqlalchemy")  # whose exceptions are told in one line


class TuningError(SsiamError):
    """A search that cannot go on: its file is damaged or of another search, or runs fail."""


class TrialError(TuningError, IncompleteError):
    """A trial some of whose runs have no result; everything else is kept."""


def open_study(path: Path, search: Mapping[str, Any]) -> Any:
    """The study in a file, new or from earlier.

    Trials that were under way when an earlier process ended are given up.

    Parameters
    ----------
    path : Path
    search : mapping
        What makes a search the same one, JSON.

    Raises
    ------
    MissingExtraError
        Optuna is not installed.
    TuningError
        The file is of another search.
    SinkError
        Its folder cannot be made.
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
    differing = [name for name in search if earlier.get(name) != search[name]]
    if differing:
        raise TuningError(
            f"{path}: is a search with other {' and '.join(differing)}; give another --out"
        )
    for trial in study.get_trials(states=[optuna.trial.TrialState.RUNNING]):
        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
    return study


def complete_trials(study: Any) -> list[Any]:
    """The trials that are done, in order."""
    from optuna.trial import TrialState

    return list(study.get_trials(deepcopy=False, states=[TrialState.COMPLETE]))


def next_trial(study: Any, parameters: Sequence[Parameter], seed: int) -> Any:
    """A trial with the paper's values if it is the first one, else with those that TPE chooses.

    The sampler is seeded anew by the number of trials that are done, so that an interruption
    leaves no trace in what follows.
    """
    import optuna

    count = len(complete_trials(study))
    study.sampler = optuna.samplers.TPESampler(seed=seed + count)
    first = paper_values(parameters)
    waiting = study.get_trials(states=[optuna.trial.TrialState.WAITING])
    if count == 0 and first is not None and not waiting:
        study.enqueue_trial(first)
    return study.ask({each.name: _distribution(each) for each in parameters})


@contextmanager
def one_line_errors(path: Path) -> Iterator[None]:
    """Turns what Optuna and its database complain of into a `TuningError`."""
    try:
        yield
    except Exception as error:
        if type(error).__module__.partition(".")[0] not in _PACKAGES:
            raise
        raise TuningError(
            f"{path}: cannot be used ({str(error).splitlines()[0]}); if it is damaged, delete it: "
            "the runs beside it are kept"
        ) from error


def _distribution(parameter: Parameter) -> Any:
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    if parameter.choices:
        return CategoricalDistribution(parameter.choices)
    if is_whole(parameter.name):
        return IntDistribution(int(parameter.low), int(parameter.high))
    return FloatDistribution(parameter.low, parameter.high, step=parameter.step)
