"""Calls side by side: in processes of this machine, or on the workers of a Dask scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, TypeVar

from ssiam.errors import ArgumentError, MissingExtraError

_PATIENCE: Final = 10  # seconds, for a scheduler to answer

Given = TypeVar("Given")
Told = TypeVar("Told")


def in_parallel(
    call: Callable[[Given], Told],
    given: Sequence[Given],
    jobs: int,
    threads: int = 1,
    cluster: str | None = None,
) -> Iterator[Told]:
    """What `call` says to each of the `given`, as they end.

    Parameters
    ----------
    call : callable
        A function of a module, for it is pickled.
    given : sequence
    jobs : int
        Processes on this machine.
    threads : int
        CPU threads of each of them.
    cluster : str, optional
        Address of a Dask scheduler to run on instead.

    Raises
    ------
    MissingExtraError
        joblib or dask is not installed.
    ArgumentError
        No scheduler answers.
    """
    try:
        import joblib

        if cluster is not None:
            from distributed import Client
    except ImportError as error:
        raise MissingExtraError("jobs need joblib and dask: pip install 'ssiam[bench]'") from error
    calls = (joblib.delayed(call)(each) for each in given)
    if cluster is None:
        settings: dict[str, Any] = {"backend": "loky", "inner_max_num_threads": threads}
        with joblib.parallel_config(n_jobs=jobs, **settings):
            yield from joblib.Parallel(return_as="generator_unordered")(calls)
        return
    try:
        client = Client(cluster, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise ArgumentError(f"no Dask scheduler answers at {cluster}; is it running?") from error
    with client, joblib.parallel_config(backend="dask"):
        yield from joblib.Parallel(return_as="generator_unordered")(calls)
