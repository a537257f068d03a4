"""Benchmark runs: many trackers over many sequences, in parallel, resumed where they stopped."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from ssiam.datasets import Dataset, Shake, VideoSequence, open_dataset, shaken
from ssiam.errors import SinkError, SsiamError, one_line
from ssiam.evaluation.measures.regions import upright
from ssiam.evaluation.measures.trajectory import Status, Trajectory
from ssiam.evaluation.runs.entries import Entry
from ssiam.evaluation.runs.identity import Identity, label_in
from ssiam.evaluation.runs.parallel import in_parallel
from ssiam.evaluation.runs.protocols import EXPERIMENTS, ProtocolName, run
from ssiam.evaluation.runs.result_files import (
    file_name,
    otb_path,
    read_vot,
    vot_path,
    write_boxes,
    write_lines,
    write_vot,
)
from ssiam.evaluation.runs.shaken_results import shaken_folder, write_shake
from ssiam.geometry import iou
from ssiam.trackers import StabilizedTracker

_log = logging.getLogger(__name__)

_CACHED_TRACKERS: Final = 2  # of a process; tasks are ordered by tracker


@dataclass(frozen=True)
class Task:
    """One run of a benchmark: a tracker on a sequence.

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
    identity : Identity
        Its weights and runtime.
    label : str
        Name of the tracker's folder of results.
    shake : Shake, optional
        Synthetic shake that is added to the sequence.
    """

    entry: Entry
    dataset: Path
    kind: str
    sequence: str
    protocol: ProtocolName
    out: Path
    identity: Identity
    label: str
    shake: Shake | None = None

    @property
    def results(self) -> Path:
        """Folder of the tracker's results."""
        return shaken_folder(self.out, self.shake) / self.label

    def read(self) -> VideoSequence:
        """The sequence, with the shake if there is one."""
        sequence = _dataset(self.dataset, self.kind).sequences[self.sequence]
        return sequence if self.shake is None else shaken(sequence, self.shake)

    @property
    def path(self) -> Path:
        """Result file of the run."""
        return vot_path(self.results, self.sequence, experiment=EXPERIMENTS[self.protocol])

    @property
    def is_finished(self) -> bool:
        """Whether the result file exists, and is of the same weights and runtime.

        Raises `ResultsError` if the record of these is damaged.
        """
        return self.path.exists() and self.identity.made(self.results, self.entry)

    @property
    def failure(self) -> Path:
        """File with the reason of a failure: ``RESULTS/failed/<experiment>/<sequence>.log``.

        A failed run is tried again by the next benchmark.
        """
        experiment = EXPERIMENTS[self.protocol]
        return self.results / "failed" / experiment / f"{file_name(self.sequence)}.log"


@dataclass(frozen=True)
class TaskResult:
    """Summary of a finished or failed run.

    Attributes
    ----------
    label, sequence : str
    frames : int
        Tracked frames: neither starts nor skipped ones.
    lost : int
        Number of lost targets.
    overlap : float
        Mean intersection over union of the tracked frames with ground truth; nan if there are none.
    seconds : float
        Tracking time; 0 for a run that was read from its file.
    failed : str
        Reason of a failure; empty for a finished run.
    shake : Shake, optional
        Synthetic shake of the sequence.
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
    shakes: Sequence[Shake | None] = (None,),
) -> list[Task]:
    """All runs of a benchmark, ordered by tracker, then shake; None means no shake.

    Raises `ResultsError` if the record of earlier results is damaged.
    """
    path, out = path.resolve(), out.resolve()
    identities = {entry: Identity.of(entry) for entry in dict.fromkeys(entries)}
    labels = {
        (entry, shake): label_in(shaken_folder(out, shake), entry, identity)
        for entry, identity in identities.items()
        for shake in shakes
    }
    return [
        Task(
            *(entry, path, dataset.kind, name, protocol, out),
            *(identities[entry], labels[entry, shake], shake),
        )
        for entry in entries
        for shake in shakes
        for name in dataset.sequences
    ]


def run_all(
    todo: Sequence[Task], jobs: int = 1, cluster: str | None = None
) -> Iterator[TaskResult]:
    """Run the tasks that have no result file yet, and yield every result as its run ends.

    A run that raises does not stop the others. The reason is in its result and in `Task.failure`,
    and the next call tries the run again.

    Parameters
    ----------
    todo : sequence of Task
    jobs : int
        Processes on this machine.
    cluster : str, optional
        Address of a Dask scheduler, such as tcp://10.0.0.1:8786; its workers must see the same
        files under the same names.

    Raises
    ------
    MissingExtraError
        joblib or dask is needed and not installed.
    ArgumentError
        The scheduler does not answer.
    """
    waiting = []
    for task in todo:
        if task.is_finished:
            yield _read(task)
        else:
            waiting.append(task)
    if cluster is None and jobs == 1:
        yield from map(run_task, waiting)
    elif waiting:
        threads = waiting[0].identity.threads
        yield from in_parallel(run_task, waiting, jobs, threads, cluster, failed=_failed)


def run_task(task: Task) -> TaskResult:
    """Run one task and write its files; an error becomes the result's `failed`."""
    try:
        cv2.setNumThreads(task.identity.threads)
        sequence = task.read()
        tracker = _tracker(task.entry, task.identity)
        task.identity.claim(task.results)
        trajectory = run(tracker, sequence, task.protocol)
        _write(task, trajectory, sequence.box(0))
        seconds = 0.0 if trajectory.seconds is None else float(trajectory.seconds.sum())
        result = _result(task, trajectory, seconds)
    except Exception as error:
        if not isinstance(error, SsiamError):
            _log.debug("%s on %s", task.label, task.sequence, exc_info=True)
        # The error may have left the cached tracker in an inconsistent state.
        _tracker.cache_clear()
        return _failed(task, one_line(error))
    with suppress(OSError):
        task.failure.unlink(missing_ok=True)
    return result


def _failed(task: Task, reason: str) -> TaskResult:
    """The result of a failed run; also writes `Task.failure`, unless the disk is full."""
    with suppress(SinkError):
        write_lines(task.failure, [reason.encode("ascii", "backslashreplace").decode()])
    return TaskResult(task.label, task.sequence, failed=reason, shake=task.shake)


def _read(task: Task) -> TaskResult:
    """The result of an earlier run; failed if its file has been damaged since."""
    try:
        return _result(task, read_vot(task.path), 0.0)
    except Exception as error:
        return TaskResult(task.label, task.sequence, failed=one_line(error), shake=task.shake)


def _write(task: Task, trajectory: Trajectory, first_xywh: tuple[float, ...]) -> None:
    """Write the files of a run; last the result file, which marks the run as finished."""
    seconds = trajectory.seconds if trajectory.seconds is not None else np.zeros(len(trajectory))
    times = task.results / "times" / EXPERIMENTS[task.protocol] / f"{task.sequence}.txt"
    write_lines(times, (f"{second:.6f}" for second in seconds))
    if task.protocol == "ope" and trajectory.regions.shape[1] == 4:
        boxes = trajectory.regions.copy()
        boxes[0] = first_xywh
        write_boxes(otb_path(task.results / "ope", task.sequence), Trajectory.from_regions(boxes))
    if task.shake is not None:
        write_shake(task.results.parent, task.shake)
    write_vot(task.path, trajectory)


def _result(task: Task, trajectory: Trajectory, seconds: float) -> TaskResult:
    sequence = task.read()
    tracked = np.flatnonzero(trajectory.status == Status.TRACKED)
    tracked = tracked[tracked < len(sequence.truth)]
    overlaps = iou(upright(trajectory.regions[tracked]), upright(sequence.truth[tracked]))
    known = np.isfinite(overlaps)
    return TaskResult(
        task.label,
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


@lru_cache(maxsize=_CACHED_TRACKERS)
def _tracker(entry: Entry, identity: Identity) -> StabilizedTracker:
    """The tracker of an entry; the identity makes that of replaced weights another one."""
    return entry.load()
