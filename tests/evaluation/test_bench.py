"""Benchmark runs: same results after an interruption, in parallel and on a cluster."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.datasets import open_dataset
from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.trajectory import Status
from ssiam.evaluation.runs.bench import run_all, run_task, tasks
from ssiam.evaluation.runs.entries import Entry
from ssiam.evaluation.runs.entries import entries as make_entries
from ssiam.evaluation.runs.result_files import read_vot
from ssiam.stabilize import StabilizerConfig

KCF = [Entry("kcf", StabilizerConfig("off")), Entry("kcf", StabilizerConfig("paper"))]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"))


def bench(dataset, out, entries=KCF, protocol="vot", **how):
    todo = tasks(entries, open_dataset(dataset), dataset, out, protocol)
    return todo, list(run_all(todo, **how))


def files(folder):
    """Contents of all result files by name, without times, which vary."""
    return {
        path.relative_to(folder): path.read_bytes()
        for path in sorted(folder.rglob("*.txt"))
        if "times" not in path.parts
    }


@pytest.fixture(scope="module")
def uninterrupted(dataset, tmp_path_factory):
    out = tmp_path_factory.mktemp("uninterrupted")
    _, results = bench(dataset, out)
    assert [run.failed for run in results] == [""] * 6
    return files(out)


def test_each_run_writes_a_file(dataset, uninterrupted):
    names = {str(path) for path in uninterrupted}
    assert "kcf-off/baseline/clip0/clip0_001.txt" in names
    assert "kcf-paper/baseline/clip2/clip2_001.txt" in names
    assert len(names) == 6


def test_results_agree_with_the_files(dataset, tmp_path):
    todo, results = bench(dataset, tmp_path)
    for task, run in zip(todo, results, strict=True):
        trajectory = read_vot(task.path)
        assert run.lost == len(trajectory.failures)
        assert run.frames == (trajectory.status == Status.TRACKED).sum()
        assert 0 < run.overlap <= 1
        assert run.seconds > 0
    assert any(run.lost for run in results)


def test_finished_runs_are_not_repeated(dataset, tmp_path):
    todo, first = bench(dataset, tmp_path)
    before = [task.path.stat().st_mtime_ns for task in todo]
    _, second = bench(dataset, tmp_path)
    assert [task.path.stat().st_mtime_ns for task in todo] == before
    assert [run.seconds for run in second] == [0.0] * 6
    assert [run.lost for run in second] == [run.lost for run in first]
    assert [run.overlap for run in second] == pytest.approx(
        [run.overlap for run in first], abs=1e-3
    )


def test_parallel_jobs_give_the_same_files(dataset, tmp_path, uninterrupted):
    bench(dataset, tmp_path, jobs=2)
    assert files(tmp_path) == uninterrupted


def test_one_pass_also_writes_box_files(dataset, tmp_path):
    bench(dataset, tmp_path, KCF[:1], "ope")
    lines = (tmp_path / "kcf-off" / "ope" / "clip0.txt").read_text().splitlines()
    assert len(lines) == 24
    assert [float(v) for v in lines[0].split(",")] == [21, 41, 28, 22]


def test_an_unreadable_sequence_does_not_stop_the_others(tmp_path):
    folder = write_dataset(tmp_path / "data", sequences=2, frames=6)
    (folder / "clip0" / "img" / "0003.jpg").write_bytes(b"not an image")
    _, results = bench(folder, tmp_path / "out", KCF[:1])
    assert "0003.jpg" in results[0].failed
    assert results[1].failed == ""
    assert [str(path) for path in files(tmp_path / "out")] == [
        "kcf-off/baseline/clip1/clip1_001.txt"
    ]


def test_labels_contain_changed_settings():
    config = StabilizerConfig("paper").with_options(keypoints="gftt", thx1=80.0)
    assert Entry("kcf", config).label == "kcf-paper-keypoints=gftt-thx1=80.0"
    assert [entry.label for entry in make_entries(["mil"], ["off", "paper"], {})] == [
        "mil-off",
        "mil-paper",
    ]
    with pytest.raises(ArgumentError, match="unknown tracker 'magic'"):
        make_entries(["magic"], ["off"], {})


COMMAND = [sys.executable, "-m", "ssiam", "bench"]


def test_resumes_with_the_same_files_after_kills(dataset, tmp_path, uninterrupted):
    """Twenty kills, each at a random time after the start, then a complete run."""
    command = [*COMMAND, str(dataset), "--out", str(tmp_path), "--trackers", "kcf"]
    command += ["--stabilize", "off,paper"]
    r = np.random.default_rng(4)
    finished = 0
    for wait in r.uniform(0.3, 2.2, 20):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            process.wait(wait)
            finished += 1
            drop_one(tmp_path, r)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    assert finished < 20
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    assert files(tmp_path) == uninterrupted


def drop_one(out: Path, r: np.random.Generator) -> None:
    """Delete up to four result files, so that the next start has runs to do."""
    results = sorted(out.rglob("*_001.txt"))
    for index in r.permutation(len(results))[:4]:
        results[index].unlink()


@pytest.fixture
def cluster():
    """Address of a Dask scheduler with two workers, each in a separate process."""
    distributed = pytest.importorskip("distributed")
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
    scheduler = subprocess.Popen(
        [*start, "--port", "0", "--no-dashboard"], stderr=subprocess.PIPE, text=True
    )
    address = next(line.split()[-1] for line in scheduler.stderr if "Scheduler at" in line)
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address]
    worker += ["--nthreads", "1", "--no-dashboard", "--no-nanny"]
    workers = [
        subprocess.Popen(worker, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for _ in range(2)
    ]
    with distributed.Client(address) as client:
        client.wait_for_workers(2, timeout=60)
    yield address
    for process in (*workers, scheduler):
        process.kill()
        process.wait()
    scheduler.stderr.close()


def test_a_cluster_gives_the_same_files(dataset, tmp_path, uninterrupted, cluster):
    _, results = bench(dataset, tmp_path, cluster=cluster)
    assert [run.failed for run in results] == [""] * 6
    assert files(tmp_path) == uninterrupted


def test_a_task_returns_its_error_instead_of_raising(dataset, tmp_path):
    todo = tasks(
        [Entry("nanotrack_v3", StabilizerConfig("off"))], open_dataset(dataset), dataset, tmp_path
    )
    assert "needs weights" in run_task(todo[0]).failed
