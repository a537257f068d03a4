"""Parallel calls: in processes of this machine, or on the workers of a Dask scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, TypeVar

from ssiam.addresses import redact_address
from ssiam.errors import ArgumentError, MissingExtraError, one_line

_CONNECT_TIMEOUT: Final = 10  # seconds
# Calls that joblib dispatches ahead for each process (its `pre_dispatch`).
_PRE_DISPATCH: Final = 2

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_parallel(
    call: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int,
    threads: int = 1,
    cluster: str | None = None,
    *,
    failed: Callable[[Item, str], Result],
) -> Iterator[Result]:
    """Results of `call` for each item, in the order in which the calls end.

    A call that raises, or whose process ends (for example because it runs out of memory), does not
    affect the others.

    Parameters
    ----------
    call : callable
        A module-level function, since it is pickled.
    items : sequence
    jobs : int
        Processes on this machine.
    threads : int
        CPU threads of each process.
    cluster : str, optional
        Address of a Dask scheduler to run on instead.
    failed : callable
        Makes the result of a call that failed, from its item and the reason.

    Raises
    ------
    MissingExtraError
        joblib or dask is not installed.
    ArgumentError
        The scheduler does not answer.
    """
    try:
        import joblib  # noqa: F401

        if cluster is not None:
            import distributed  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("jobs need joblib and dask: pip install 'ssiam[bench]'") from error
    if cluster is None:
        yield from _on_this_machine(call, items, jobs, threads, failed)
    else:
        yield from _on_cluster(call, items, cluster, failed)


def _on_this_machine(
    call: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int,
    threads: int,
    failed: Callable[[Item, str], Result],
) -> Iterator[Result]:
    waiting = dict(enumerate(items))
    while waiting:
        try:
            for index, result, reason in _pool(call, waiting, jobs, threads):
                item = waiting.pop(index)
                yield failed(item, reason) if result is None else result
        except _broken_pool_error():
            # One of the dispatched calls ended its process. Each of them is run again in a
            # separate pool.
            for index in list(waiting)[: jobs * (1 + _PRE_DISPATCH)]:
                suspect = waiting.pop(index)
                try:
                    ((_, result, reason),) = _pool(call, {index: suspect}, jobs, threads)
                except _broken_pool_error() as error:
                    result, reason = None, f"its process ended ({_first_sentence(error)})"
                yield failed(suspect, reason) if result is None else result


def _pool(
    call: Callable[[Item], Result], waiting: dict[int, Item], jobs: int, threads: int
) -> Iterator[tuple[int, Result | None, str]]:
    """The value of `_indexed_call` for each waiting item, in the order in which the calls end."""
    import joblib

    # With a single job joblib would run the calls in this process.
    settings: dict[str, Any] = {"backend": "loky", "inner_max_num_threads": threads}
    with joblib.parallel_config(n_jobs=max(jobs, 2), **settings):
        calls = (joblib.delayed(_indexed_call)(call, *each) for each in list(waiting.items()))
        yield from joblib.Parallel(return_as="generator_unordered")(calls)


def _indexed_call(
    call: Callable[[Item], Result], index: int, item: Item
) -> tuple[int, Result | None, str]:
    """Index, result, and the reason if there is none."""
    try:
        return index, call(item), ""
    except Exception as error:
        return index, None, one_line(error)


def _broken_pool_error() -> type[Exception]:
    """The exception that joblib raises if a worker process ends during a call."""
    from joblib.externals.loky.process_executor import BrokenProcessPool

    found: type[Exception] = BrokenProcessPool
    return found


def _first_sentence(error: Exception) -> str:
    """The message without joblib's guesses at the cause."""
    return " ".join(str(error).split()).partition(". ")[0]


def _on_cluster(
    call: Callable[[Item], Result],
    items: Sequence[Item],
    cluster: str,
    failed: Callable[[Item, str], Result],
) -> Iterator[Result]:
    from distributed import Client, KilledWorker, as_completed

    try:
        client = Client(cluster, timeout=_CONNECT_TIMEOUT)
    except (OSError, ValueError):
        name = redact_address(cluster)
        # The cause would print the whole address, with its password.
        raise ArgumentError(f"no Dask scheduler answers at {name}; is it running?") from None
    with client:
        submitted = {client.submit(call, each, pure=False): each for each in items}
        suspects = []
        for future in as_completed(list(submitted)):
            if isinstance(future.exception(), KilledWorker):
                suspects.append(submitted[future])
            else:
                yield _result_on_cluster(submitted[future], future, failed)
        # The others waited on a worker that one of them has ended. Each is run again, alone.
        for item in suspects:
            yield _result_on_cluster(item, client.submit(call, item, pure=False), failed)


def _result_on_cluster(item: Item, future: Any, failed: Callable[[Item, str], Result]) -> Result:
    """The result of a call, or that of its failure; waits for its end."""
    problem = future.exception()
    result: Result = failed(item, one_line(problem)) if problem else future.result()
    return result
