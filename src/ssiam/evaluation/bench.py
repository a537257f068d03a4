"""Runs of many trackers over many sequences: in parallel, and never twice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from ssiam.datasets import Dataset, open_dataset
from ssiam.errors import ArgumentError, MissingExtraError, SsiamError
from ssiam.evaluation.entries import Entry
from ssiam.evaluation.layouts import otb_path, read_vot, vot_path, write_boxes, write_vot
from ssiam.evaluation.lines import write_lines
from ssiam.evaluation.overlap import iou
from ssiam.evaluation.protocols import EXPERIMENTS, ProtocolName, run
from ssiam.evaluation.regions import upright
from ssiam.evaluation.trajectory import Status, Trajectory
from ssiam.trackers import SteadiedTracker

_PATIENCE: Final = 10  # seconds, for a scheduler to answer
_LOADED: Final = 2  # trackers that a process keeps; tasks come tracker by tracker


@dataclass(frozen=True)
class Task:
    """One run: a tracker on a sequence.

    Attributes
    ----------
    entry : Entry
    dataset : Path
    kind : str
        Layout of the dataset.
    sequence : str
    protocol : {"vot", "ope", "realtime"}
    out : Path
        Folder of all results.
    threads : int
        CPU threads of the run.
    """

    entry: Entry
    dataset: Path
    kind: str
    sequence: str
    protocol: ProtocolName
    out: Path
    threads: int = 1

    @property
    def results(self) -> Path:
        """The tracker's folder."""
        return self.out / self.entry.label

    @property
    def path(self) -> Path:
        """File of the run; that it exists means that the run is done."""
        return vot_path(self.results, self.sequence, experiment=EXPERIMENTS[self.protocol])


@dataclass(frozen=True)
class Done:
    """A run that has ended.

    Attributes
    ----------
    label, sequence : str
    frames : int
        Tracked frames: neither starts nor skipped ones.
    lost : int
    overlap : float
        Mean intersection over union of the tracked frames whose truth is told; nan if none.
    seconds : float
        Time in the tracker; 0 if the run was there already.
    failed : str
        Why there is no result.
    """

    label: str
    sequence: str
    frames: int = 0
    lost: int = 0
    overlap: float = float("nan")
    seconds: float = 0.0
    failed: str = ""


def tasks(
    entries: Sequence[Entry],
    dataset: Dataset,
    path: Path,
    out: Path,
    protocol: ProtocolName = "vot",
    threads: int = 1,
) -> list[Task]:
    """All runs of a benchmark, tracker by tracker."""
    return [
        Task(entry, path.resolve(), dataset.kind, name, protocol, out.resolve(), threads)
        for entry in entries
        for name in dataset.sequences
    ]


def run_all(todo: Sequence[Task], jobs: int = 1, cluster: str | None = None) -> Iterator[Done]:
    """Run what is not done yet, and tell of every run as it ends.

    Parameters
    ----------
    todo : sequence of Task
    jobs : int
        Processes on this machine.
    cluster : str, optional
        Address of a Dask scheduler, such as tcp://10.0.0.1:8786; its workers must see the same
        files under the same names.
    """
    waiting = []
    for task in todo:
        if task.path.exists():
            yield _told(task, read_vot(task.path), 0.0)
        else:
            waiting.append(task)
    if cluster is None and jobs == 1:
        yield from map(run_task, waiting)
    elif waiting:
        yield from _parallel(waiting, jobs, cluster)


def _parallel(waiting: Sequence[Task], jobs: int, cluster: str | None) -> Iterator[Done]:
    try:
        import joblib

        if cluster is not None:
            from distributed import Client
    except ImportError as error:
        raise MissingExtraError("jobs need joblib and dask: pip install 'ssiam[bench]'") from error
    calls = (joblib.delayed(run_task)(task) for task in waiting)
    if cluster is None:
        settings: dict[str, Any] = {"backend": "loky", "inner_max_num_threads": waiting[0].threads}
        with joblib.parallel_config(n_jobs=jobs, **settings):
            yield from joblib.Parallel(return_as="generator_unordered")(calls)
        return
    try:
        client = Client(cluster, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise ArgumentError(f"no Dask scheduler answers at {cluster}; is it running?") from error
    with client, joblib.parallel_config(backend="dask"):
        yield from joblib.Parallel(return_as="generator_unordered")(calls)


def run_task(task: Task) -> Done:
    """Run one task and write its file; what goes wrong is told, not raised."""
    cv2.setNumThreads(task.threads)
    try:
        sequence = _dataset(task.dataset, task.kind).sequences[task.sequence]
        trajectory = run(_tracker(task.entry, task.threads), sequence, task.protocol)
        _write(task, trajectory, sequence.box(0))
        seconds = 0.0 if trajectory.seconds is None else float(trajectory.seconds.sum())
        return _told(task, trajectory, seconds)
    except SsiamError as error:
        return Done(task.entry.label, task.sequence, failed=str(error))


def _write(task: Task, trajectory: Trajectory, first_xywh: tuple[float, ...]) -> None:
    """The official files, and beside them the times; the one that means "done" comes last."""
    seconds = trajectory.seconds if trajectory.seconds is not None else np.zeros(len(trajectory))
    times = task.results / "times" / EXPERIMENTS[task.protocol] / f"{task.sequence}.txt"
    write_lines(times, (f"{second:.6f}" for second in seconds))
    if task.protocol == "ope" and trajectory.regions.shape[1] == 4:
        boxes = trajectory.regions.copy()
        boxes[0] = first_xywh
        write_boxes(otb_path(task.results / "ope", task.sequence), Trajectory.of_boxes(boxes))
    write_vot(task.path, trajectory)


def _told(task: Task, trajectory: Trajectory, seconds: float) -> Done:
    sequence = _dataset(task.dataset, task.kind).sequences[task.sequence]
    tracked = np.flatnonzero(trajectory.status == Status.TRACKED)
    tracked = tracked[tracked < len(sequence.truth)]
    overlaps = iou(upright(trajectory.regions[tracked]), upright(sequence.truth[tracked]))
    known = np.isfinite(overlaps)
    return Done(
        task.entry.label,
        task.sequence,
        frames=int((trajectory.status == Status.TRACKED).sum()),
        lost=len(trajectory.failures),
        overlap=float(overlaps[known].mean()) if known.any() else float("nan"),
        seconds=seconds,
    )


@lru_cache(maxsize=2)
def _dataset(path: Path, kind: str) -> Dataset:
    return open_dataset(path, kind)


@lru_cache(maxsize=_LOADED)
def _tracker(entry: Entry, threads: int) -> SteadiedTracker:
    return entry.load(threads)
