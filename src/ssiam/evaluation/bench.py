"""Runs of many trackers over many sequences: in parallel, and never twice."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from ssiam.datasets import Dataset, Shake, open_dataset, shaken
from ssiam.datasets import Sequence as Clip
from ssiam.errors import SsiamError, one_line
from ssiam.evaluation.entries import Entry
from ssiam.evaluation.failures import clear_failure, failure_path, write_failure
from ssiam.evaluation.layouts import otb_path, read_vot, vot_path, write_boxes, write_vot
from ssiam.evaluation.lines import write_lines
from ssiam.evaluation.parallel import in_parallel
from ssiam.evaluation.protocols import EXPERIMENTS, ProtocolName, run
from ssiam.evaluation.regions import upright
from ssiam.evaluation.shaken_results import shaken_folder, write_shake
from ssiam.evaluation.trajectory import Status, Trajectory
from ssiam.geometry import iou
from ssiam.trackers import StabilizedTracker

_log = logging.getLogger(__name__)

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
    shake : Shake, optional
        What the sequence is shaken by.
    """

    entry: Entry
    dataset: Path
    kind: str
    sequence: str
    protocol: ProtocolName
    out: Path
    threads: int = 1
    shake: Shake | None = None

    @property
    def results(self) -> Path:
        """The tracker's folder."""
        return shaken_folder(self.out, self.shake) / self.entry.label

    def read(self) -> Clip:
        """The sequence, shaken if it is to be."""
        sequence = _dataset(self.dataset, self.kind).sequences[self.sequence]
        return sequence if self.shake is None else shaken(sequence, self.shake)

    @property
    def path(self) -> Path:
        """File of the run; that it exists means that the run is done."""
        return vot_path(self.results, self.sequence, experiment=EXPERIMENTS[self.protocol])

    @property
    def failure(self) -> Path:
        """File that says why the run has no result; a run that has one is tried again."""
        return failure_path(self.results, self.sequence, EXPERIMENTS[self.protocol])


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
    shake : Shake, optional
        What the sequence was shaken by.
    """

    label: str
    sequence: str
    frames: int = 0
    lost: int = 0
    overlap: float = float("nan")
    seconds: float = 0.0
    failed: str = ""
    shake: Shake | None = None


def tasks(
    entries: Sequence[Entry],
    dataset: Dataset,
    path: Path,
    out: Path,
    protocol: ProtocolName = "vot",
    threads: int = 1,
    shakes: Sequence[Shake | None] = (None,),
) -> list[Task]:
    """All runs of a benchmark, tracker by tracker, shake by shake; None is no shake."""
    path, out = path.resolve(), out.resolve()
    return [
        Task(entry, path, dataset.kind, name, protocol, out, threads, shake)
        for entry in entries
        for shake in shakes
        for name in dataset.sequences
    ]


def run_all(todo: Sequence[Task], jobs: int = 1, cluster: str | None = None) -> Iterator[Done]:
    """Run what is not done yet, and tell of every run as it ends.

    A run that fails, whatever it raises, ends no other; the reason is told, and kept in
    `Task.failure`. It is tried again the next time.

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
            yield _read(task)
        else:
            waiting.append(task)
    if cluster is None and jobs == 1:
        yield from map(run_task, waiting)
    elif waiting:
        yield from in_parallel(run_task, waiting, jobs, waiting[0].threads, cluster, failed=_failed)


def run_task(task: Task) -> Done:
    """Run one task and write its file; what goes wrong is told, not raised."""
    try:
        cv2.setNumThreads(task.threads)
        sequence = task.read()
        trajectory = run(_tracker(task.entry, task.threads), sequence, task.protocol)
        _write(task, trajectory, sequence.box(0))
        seconds = 0.0 if trajectory.seconds is None else float(trajectory.seconds.sum())
        done = _told(task, trajectory, seconds)
    except Exception as error:
        if not isinstance(error, SsiamError):
            _log.debug("%s on %s", task.entry.label, task.sequence, exc_info=True)
        # What a tracker has been through may have left it in pieces.
        _tracker.cache_clear()
        return _failed(task, one_line(error))
    clear_failure(task.failure)
    return done


def _failed(task: Task, reason: str) -> Done:
    """A run without a result, which is recorded."""
    write_failure(task.failure, reason)
    return Done(task.entry.label, task.sequence, failed=reason, shake=task.shake)


def _read(task: Task) -> Done:
    """A run of an earlier time, which may have been damaged since."""
    try:
        return _told(task, read_vot(task.path), 0.0)
    except Exception as error:
        return Done(task.entry.label, task.sequence, failed=one_line(error), shake=task.shake)


def _write(task: Task, trajectory: Trajectory, first_xywh: tuple[float, ...]) -> None:
    """The official files, and beside them the times; the one that means "done" comes last."""
    seconds = trajectory.seconds if trajectory.seconds is not None else np.zeros(len(trajectory))
    times = task.results / "times" / EXPERIMENTS[task.protocol] / f"{task.sequence}.txt"
    write_lines(times, (f"{second:.6f}" for second in seconds))
    if task.protocol == "ope" and trajectory.regions.shape[1] == 4:
        boxes = trajectory.regions.copy()
        boxes[0] = first_xywh
        write_boxes(otb_path(task.results / "ope", task.sequence), Trajectory.of_boxes(boxes))
    if task.shake is not None:
        write_shake(task.results.parent, task.shake)
    write_vot(task.path, trajectory)


def _told(task: Task, trajectory: Trajectory, seconds: float) -> Done:
    sequence = task.read()
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
        shake=task.shake,
    )


@lru_cache(maxsize=2)
def _dataset(path: Path, kind: str) -> Dataset:
    return open_dataset(path, kind)


@lru_cache(maxsize=_LOADED)
def _tracker(entry: Entry, threads: int) -> StabilizedTracker:
    return entry.load(threads)
