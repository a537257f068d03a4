"""Calls side by side: in processes of this machine, or on the workers of a Dask scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, TypeVar

from ssiam.errors import ArgumentError, MissingExtraError, one_line

_PATIENCE: Final = 10  # seconds, for a scheduler to answer
# Calls that joblib hands out ahead for each process (its `pre_dispatch`).
_AHEAD: Final = 2

Given = TypeVar("Given")
Told = TypeVar("Told")


def in_parallel(
    call: Callable[[Given], Told],
    given: Sequence[Given],
    jobs: int,
    threads: int = 1,
    cluster: str | None = None,
    *,
    failed: Callable[[Given, str], Told],
) -> Iterator[Told]:
    """What `call` says to each of the `given`, as they end.

    A call that raises, or whose process ends under it (killed for its memory, say), ends no
    other.

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
    failed : callable
        What is said instead for a call that has no answer, from it and the reason.

    Raises
    ------
    MissingExtraError
        joblib or dask is not installed.
    ArgumentError
        No scheduler answers.
    """
    try:
        import joblib  # noqa: F401

        if cluster is not None:
            import distributed  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("jobs need joblib and dask: pip install 'ssiam[bench]'") from error
    if cluster is None:
        yield from _on_this_machine(call, given, jobs, threads, failed)
    else:
        yield from _on_cluster(call, given, cluster, failed)


def _on_this_machine(
    call: Callable[[Given], Told],
    given: Sequence[Given],
    jobs: int,
    threads: int,
    failed: Callable[[Given, str], Told],
) -> Iterator[Told]:
    waiting = dict(enumerate(given))
    while waiting:
        try:
            for place, told, reason in _pool(call, waiting, jobs, threads):
                asked = waiting.pop(place)
                yield failed(asked, reason) if told is None else told
        except _process_ended():
            # One of those that were handed out. They are run again, each in a pool of its own.
            for place in list(waiting)[: jobs * (1 + _AHEAD)]:
                suspect = waiting.pop(place)
                try:
                    ((_, told, reason),) = _pool(call, {place: suspect}, jobs, threads)
                except _process_ended() as error:
                    told, reason = None, f"its process ended ({_first_sentence(error)})"
                yield failed(suspect, reason) if told is None else told


def _pool(
    call: Callable[[Given], Told], waiting: dict[int, Given], jobs: int, threads: int
) -> Iterator[tuple[int, Told | None, str]]:
    """The answers to the calls, as `_placed`, as they end."""
    import joblib

    # With one job joblib uses no process of its own.
    settings: dict[str, Any] = {"backend": "loky", "inner_max_num_threads": threads}
    with joblib.parallel_config(n_jobs=max(jobs, 2), **settings):
        calls = (joblib.delayed(_placed)(call, *each) for each in list(waiting.items()))
        yield from joblib.Parallel(return_as="generator_unordered")(calls)


def _placed(
    call: Callable[[Given], Told], place: int, given: Given
) -> tuple[int, Told | None, str]:
    """The place of a call, its answer, and why there is none."""
    try:
        return place, call(given), ""
    except Exception as error:
        return place, None, one_line(error)


def _process_ended() -> type[Exception]:
    """What joblib raises when a process has ended that was at work."""
    from joblib.externals.loky.process_executor import BrokenProcessPool

    found: type[Exception] = BrokenProcessPool
    return found


def _first_sentence(error: Exception) -> str:
    """Without joblib's advice on what may have been the reason."""
    return " ".join(str(error).split()).partition(". ")[0]


def _on_cluster(
    call: Callable[[Given], Told],
    given: Sequence[Given],
    cluster: str,
    failed: Callable[[Given, str], Told],
) -> Iterator[Told]:
    from distributed import Client, as_completed

    try:
        client = Client(cluster, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise ArgumentError(f"no Dask scheduler answers at {cluster}; is it running?") from error
    with client:
        asked = {client.submit(call, each, pure=False): each for each in given}
        for future in as_completed(list(asked)):
            problem = future.exception()
            yield failed(asked[future], one_line(problem)) if problem else future.result()
