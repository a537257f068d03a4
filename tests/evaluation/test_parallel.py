"""Parallel calls: one that raises or ends its process does not affect the others."""

import os
import subprocess
import sys

import pytest

from ssiam.errors import ArgumentError, MissingExtraError
from ssiam.evaluation.runs import parallel
from ssiam.evaluation.runs.parallel import (
    _broken_pool_error,
    _first_sentence,
    _indexed_call,
    in_parallel,
)

KILLED = "__import__('os').kill(__import__('os').getpid(), 9)"
CALLS = ["1 + 1", "1 / 0", KILLED, "2 + 2", "3 + 3", "4 + 4", KILLED + " or 1", "5 + 5", "6 + 6"]


def failed(item, reason):
    return item, reason


def evaluated(items, jobs, **how):
    return list(in_parallel(eval, items, jobs, failed=failed, **how))


@pytest.mark.parametrize("jobs", [2, 3])
def test_all_other_calls_give_results(jobs):
    pytest.importorskip("joblib")
    results = evaluated(CALLS, jobs)
    reasons = dict(each for each in results if isinstance(each, tuple))
    assert sorted(each for each in results if isinstance(each, int)) == [2, 4, 6, 8, 10, 12]
    assert reasons["1 / 0"] == "ZeroDivisionError: division by zero"
    assert set(reasons) == {"1 / 0", KILLED, KILLED + " or 1"}
    assert "its process ended" in reasons[KILLED]
    assert len(reasons[KILLED]) < 200


def test_failing_calls_on_a_cluster():
    distributed = pytest.importorskip("distributed")
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
    # Calls that wait on a worker fail with the one that kills it.
    scheduler = subprocess.Popen(
        [*start, "--port", "0", "--no-dashboard"],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"},
    )
    address = next(line.split()[-1] for line in scheduler.stderr if "Scheduler at" in line)
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address]
    worker += ["--nthreads", "1", "--no-dashboard", "--nworkers", "2"]
    # With nannies, which restart killed workers.
    workers = subprocess.Popen(worker, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with distributed.Client(address) as client:
            client.wait_for_workers(2, timeout=60)
        results = evaluated([KILLED, "1 + 1", "1 / 0", "2 + 2", "3 + 3"], 1, cluster=address)
    finally:
        for process in (workers, scheduler):
            process.terminate()
            process.wait()
        scheduler.stderr.close()
    reasons = dict(each for each in results if isinstance(each, tuple))
    assert sorted(each for each in results if isinstance(each, int)) == [2, 4, 6]
    assert set(reasons) == {"1 / 0", KILLED}
    assert "ZeroDivisionError" in reasons["1 / 0"]
    assert "KilledWorker" in reasons[KILLED]


def raising(item):
    raise ValueError(f"no {item}\nat all")


def test_a_call_has_its_index_and_a_reason_without_a_result():
    assert _indexed_call(eval, 7, "1 + 1") == (7, 2, "")
    index, result, reason = _indexed_call(raising, 3, "luck")
    assert (index, result) == (3, None)
    assert reason.startswith("ValueError: no luck")
    assert "\n" not in reason


def test_only_the_first_sentence_of_joblib_is_shown():
    error = RuntimeError("A worker\n stopped. This could be caused by a fault. Or not.")
    assert _first_sentence(error) == "A worker stopped"


class Broken(Exception):
    """Stands for joblib's exception."""


def test_calls_of_a_broken_pool_are_run_again_one_by_one(monkeypatch):
    """With two jobs, six calls were dispatched; the others go into a new pool."""
    pools = []

    def pool(call, waiting, jobs, threads):
        pools.append((sorted(waiting), jobs, threads))
        if len(waiting) == 1 and "killed" in waiting.values():
            raise Broken("It was killed. Why?")
        if len(waiting) == 9:
            yield 8, "8", ""
            raise Broken
        for index, item in list(waiting.items()):
            yield index, None if item == "wrong" else item.upper(), "is wrong"

    monkeypatch.setattr(parallel, "_pool", pool)
    monkeypatch.setattr(parallel, "_broken_pool_error", lambda: Broken)
    items = ["a", "killed", "c", "wrong", "e", "f", "g", "h", "last"]
    results = list(in_parallel(str, items, 2, 3, failed=failed))
    assert results == [
        *("8", "A", ("killed", "its process ended (It was killed)"), "C", ("wrong", "is wrong")),
        *("E", "F", "G", "H"),
    ]
    assert pools == [
        (list(range(9)), 2, 3),
        *(([index], 2, 3) for index in range(6)),
        ([6, 7], 2, 3),
    ]


def test_settings_of_the_pool(monkeypatch):
    joblib = pytest.importorskip("joblib")
    configured, kinds = [], []
    config = joblib.parallel_config

    def recording(**settings):
        configured.append(settings)
        return config(backend="threading", n_jobs=settings["n_jobs"])

    real = joblib.Parallel

    def parallel_of(**options):
        kinds.append(options)
        return real(**options)

    monkeypatch.setattr(joblib, "parallel_config", recording)
    monkeypatch.setattr(joblib, "Parallel", parallel_of)
    waiting = {4: "1 + 1", 2: "1 / 0"}
    found = sorted(parallel._pool(eval, waiting, 1, 3), key=lambda each: each[0])
    assert found == [(2, None, "ZeroDivisionError: division by zero"), (4, 2, "")]
    list(parallel._pool(eval, waiting, 5, 1))
    common = {"backend": "loky"}
    assert configured == [
        {**common, "n_jobs": 2, "inner_max_num_threads": 3},
        {**common, "n_jobs": 5, "inner_max_num_threads": 1},
    ]
    assert kinds == [{"return_as": "generator_unordered"}] * 2


def test_the_pools_error_is_joblibs():
    pytest.importorskip("joblib")
    assert _broken_pool_error().__name__ == "BrokenProcessPool"


def test_a_scheduler_that_does_not_answer_is_an_error(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(parallel, "_CONNECT_TIMEOUT", 0.2)
    for address in ("tcp://127.0.0.1:9", "nonsense"):
        message = f"no Dask scheduler answers at {address}; is it running"
        with pytest.raises(ArgumentError, match=message):
            evaluated(["1"], 1, cluster=address)


@pytest.mark.parametrize(
    ("missing", "how"), [("joblib", {}), ("distributed", {"cluster": "tcp://127.0.0.1:9"})]
)
def test_missing_packages_name_the_extra(monkeypatch, missing, how):
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(MissingExtraError, match=r"need joblib and dask: pip install 'ssiam\[bench"):
        evaluated(["1"], 2, **how)


class Future:
    def __init__(self, value):
        self.value = value

    def exception(self):
        return self.value if isinstance(self.value, Exception) else None

    def result(self):
        return self.value


class Client:
    """A client whose calls have ended at once."""

    made = None

    def __init__(self, address, timeout):
        self.given = address, timeout
        self.pure = []
        Client.made.append(self)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.closed = True

    def submit(self, call, item, pure):
        self.pure.append(pure)
        try:
            return Future(call(item))
        except Exception as error:
            return Future(error)


def test_calls_on_a_cluster(monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "Client", Client)
    monkeypatch.setattr(distributed, "as_completed", lambda futures: reversed(futures))
    monkeypatch.setattr(Client, "made", [])
    results = evaluated(["1 + 1", "1 / 0", "3"], 1, cluster="tcp://a:1")
    assert results == [3, ("1 / 0", "ZeroDivisionError: division by zero"), 2]
    (client,) = Client.made
    assert client.given == ("tcp://a:1", 10)
    assert client.pure == [False] * 3
    assert client.closed
