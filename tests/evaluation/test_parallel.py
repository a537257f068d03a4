"""Parallel calls: one that raises or ends its process does not affect the others."""

import os
import subprocess
import sys

import pytest

from ssiam.evaluation.runs.parallel import in_parallel

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
    scheduler = subprocess.Popen(
        [*start, "--port", "0", "--no-dashboard"], stderr=subprocess.PIPE, text=True
    )
    address = next(line.split()[-1] for line in scheduler.stderr if "Scheduler at" in line)
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address]
    worker += ["--nthreads", "1", "--no-dashboard", "--nworkers", "2"]
    # With nannies, which restart killed workers.
    workers = subprocess.Popen(
        worker,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"},
    )
    try:
        with distributed.Client(address) as client:
            client.wait_for_workers(2, timeout=60)
        results = evaluated(["1 + 1", "1 / 0", "2 + 2", KILLED, "3 + 3"], 1, cluster=address)
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
