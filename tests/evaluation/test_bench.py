"""Benchmarks that are interrupted, run side by side, or on a cluster, come out the same."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.datasets import open_dataset
from ssiam.errors import ArgumentError
from ssiam.evaluation.bench import run_all, run_task, tasks
from ssiam.evaluation.entries import Entry, entries
from ssiam.evaluation.layouts import read_vot
from ssiam.evaluation.trajectory import Status
from ssiam.stabilize import StabilizerConfig

KCF = [Entry("kcf", StabilizerConfig("off")), Entry("kcf", StabilizerConfig("paper"))]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"))


def bench(dataset, out, competitors=KCF, protocol="vot", **how):
    todo = tasks(competitors, open_dataset(dataset), dataset, out, protocol)
    return todo, list(run_all(todo, **how))


def files(folder):
    """Bytes of every official file by its name; times differ from run to run."""
    return {
        path.relative_to(folder): path.read_bytes()
        for path in sorted(folder.rglob("*.txt"))
        if "times" not in path.parts
    }


@pytest.fixture(scope="module")
def undisturbed(dataset, tmp_path_factory):
    out = tmp_path_factory.mktemp("undisturbed")
    _, done = bench(dataset, out)
    assert [run.failed for run in done] == [""] * 6
    return files(out)


def test_every_run_has_its_files(dataset, undisturbed):
    names = {str(path) for path in undisturbed}
    assert "kcf-off/baseline/clip0/clip0_001.txt" in names
    assert "kcf-paper/baseline/clip2/clip2_001.txt" in names
    assert len(names) == 6


def test_what_is_told_is_what_is_written(dataset, tmp_path):
    todo, done = bench(dataset, tmp_path)
    for task, run in zip(todo, done, strict=True):
        trajectory = read_vot(task.path)
        assert run.lost == len(trajectory.failures)
        assert run.frames == (trajectory.status == Status.TRACKED).sum()
        assert 0 < run.overlap <= 1
        assert run.seconds > 0
    assert any(run.lost for run in done)


def test_what_is_done_is_not_done_again(dataset, tmp_path):
    todo, first = bench(dataset, tmp_path)
    before = [task.path.stat().st_mtime_ns for task in todo]
    _, second = bench(dataset, tmp_path)
    assert [task.path.stat().st_mtime_ns for task in todo] == before
    assert [run.seconds for run in second] == [0.0] * 6
    assert [run.lost for run in second] == [run.lost for run in first]
    assert [run.overlap for run in second] == pytest.approx(
        [run.overlap for run in first], abs=1e-3
    )


def test_side_by_side_is_the_same(dataset, tmp_path, undisturbed):
    bench(dataset, tmp_path, jobs=2)
    assert files(tmp_path) == undisturbed


def test_one_pass_writes_the_boxes_too(dataset, tmp_path):
    bench(dataset, tmp_path, KCF[:1], "ope")
    lines = (tmp_path / "kcf-off" / "ope" / "clip0.txt").read_text().splitlines()
    assert len(lines) == 24
    assert [float(v) for v in lines[0].split(",")] == [21, 41, 28, 22]


def test_a_sequence_that_cannot_be_read_stops_no_other(tmp_path):
    folder = write_dataset(tmp_path / "data", sequences=2, frames=6)
    (folder / "clip0" / "img" / "0003.jpg").write_bytes(b"no picture")
    _, done = bench(folder, tmp_path / "out", KCF[:1])
    assert "0003.jpg" in done[0].failed
    assert done[1].failed == ""
    assert [str(path) for path in files(tmp_path / "out")] == [
        "kcf-off/baseline/clip1/clip1_001.txt"
    ]


def test_labels_tell_what_was_changed():
    config = StabilizerConfig("paper").with_options(keypoints="gftt", thx1=80.0)
    assert Entry("kcf", config).label == "kcf-paper-keypoints=gftt-thx1=80.0"
    assert [entry.label for entry in entries(["mil"], ["off", "paper"], {})] == [
        "mil-off",
        "mil-paper",
    ]
    with pytest.raises(ArgumentError, match="unknown tracker 'magic'"):
        entries(["magic"], ["off"], {})


COMMAND = [sys.executable, "-m", "ssiam", "bench"]


def test_killed_at_any_moment_it_goes_on_to_the_same_end(dataset, tmp_path, undisturbed):
    """Twenty kills, each a random while after the start, and then to the end."""
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
    assert files(tmp_path) == undisturbed


def drop_one(out: Path, r: np.random.Generator) -> None:
    """Make work for the next start."""
    results = sorted(out.rglob("*_001.txt"))
    for index in r.permutation(len(results))[:4]:
        results[index].unlink()


@pytest.fixture
def cluster():
    """A Dask scheduler and two workers, each a process of its own."""
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


def test_a_cluster_gives_the_same(dataset, tmp_path, undisturbed, cluster):
    _, done = bench(dataset, tmp_path, cluster=cluster)
    assert [run.failed for run in done] == [""] * 6
    assert files(tmp_path) == undisturbed


def test_a_task_tells_what_went_wrong_instead_of_raising(dataset, tmp_path):
    todo = tasks(
        [Entry("nanotrack_v3", StabilizerConfig("off"))], open_dataset(dataset), dataset, tmp_path
    )
    assert "needs weights" in run_task(todo[0]).failed
