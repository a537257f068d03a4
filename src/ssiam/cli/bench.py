"""`ssiam bench`: run several trackers over several sequences."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
from cyclopts import Group, Parameter
from rich.console import Console
from rich.live import Live
from rich.table import Table

from ssiam.cli.options import (
    RUNTIME_GROUP,
    check_results_folder,
    parse_shakes,
    parse_weights,
    split_words,
)
from ssiam.datasets import Dataset, Shake, ShakeBorder, open_dataset
from ssiam.errors import ArgumentError, IncompleteError, check_choice
from ssiam.evaluation.paper.presets import PRESETS, preset
from ssiam.evaluation.runs.bench import Task, TaskResult, run_all, tasks
from ssiam.evaluation.runs.entries import entries
from ssiam.evaluation.runs.protocols import ProtocolName
from ssiam.runtime import DeviceName, Precision, RuntimeName, RuntimeOptions
from ssiam.runtime.network import max_threads
from ssiam.stabilize import METHODS

_RUNS_GROUP = Group("Runs", sort_key=1)
_SHAKE_GROUP = Group("Added camera shake", sort_key=2)
_EXECUTION_GROUP = Group("Execution", sort_key=3)

_FILE_WIDTH = 120  # characters of the table if it does not go to a terminal

_RowKey: TypeAlias = tuple[str, float]
"""Label of the tracker and strength of the shake."""


def bench(
    *dataset: Path,
    out: Annotated[Path, Parameter(group=_RUNS_GROUP)],
    trackers: Annotated[str | None, Parameter(group=_RUNS_GROUP)] = None,
    stabilize: Annotated[str, Parameter(group=_RUNS_GROUP)] = "off,paper,predict",
    weights: Annotated[list[str] | None, Parameter(group=_RUNS_GROUP, negative=())] = None,
    template_memory: Annotated[bool, Parameter(group=_RUNS_GROUP, negative=())] = False,
    distractors: Annotated[bool | None, Parameter(group=_RUNS_GROUP)] = None,
    protocol: Annotated[ProtocolName, Parameter(group=_RUNS_GROUP)] = "vot",
    preset_name: Annotated[str | None, Parameter(name="--preset", group=_RUNS_GROUP)] = None,
    shake: Annotated[str, Parameter(group=_SHAKE_GROUP)] = "0",
    shake_kind: Annotated[str, Parameter(group=_SHAKE_GROUP)] = "white",
    shake_seeds: Annotated[int, Parameter(group=_SHAKE_GROUP)] = 1,
    shake_exposure: Annotated[float, Parameter(group=_SHAKE_GROUP)] = 0.0,
    shake_readout: Annotated[float, Parameter(group=_SHAKE_GROUP)] = 0.0,
    shake_border: Annotated[ShakeBorder, Parameter(group=_SHAKE_GROUP)] = "reflect",
    jobs: Annotated[int, Parameter(group=_EXECUTION_GROUP)] = 1,
    cluster: Annotated[str | None, Parameter(group=_EXECUTION_GROUP)] = None,
    runtime: Annotated[RuntimeName, Parameter(group=RUNTIME_GROUP)] = "openvino",
    device: Annotated[DeviceName | None, Parameter(group=RUNTIME_GROUP)] = None,
    precision: Annotated[Precision, Parameter(group=RUNTIME_GROUP)] = "f32",
    threads: Annotated[int, Parameter(group=RUNTIME_GROUP)] = 1,
) -> None:
    """Run trackers over datasets, each with and without stabilization.

    Finished runs are not repeated: after an interruption, start the same command again to
    continue. Runs with other weights, with another runtime, device, precision or number of
    threads, or with a template memory or distractors, are other runs, with results of their own.

    Parameters
    ----------
    dataset
        Datasets: folders of VOT, OTB, UAV123, DTB70, GOT-10k, LaSOT or MOTChallenge, a .json file
        of pysot such as VOT2018.json, or a folder of images or videos with a .txt of boxes.
    out
        Folder of the results: OUT/TRACKER-STABILIZE/baseline/SEQUENCE/SEQUENCE_001.txt.
    trackers
        Comma-separated names of trackers. By default csrt; with --preset, csrt, kcf, the trackers
        of --weights, and the paper's whose weights are imported. package.module:Class is a class of
        your own or of another package, whose code is run; not with --preset.
    stabilize
        Comma-separated stabilization methods: off, paper, literal, predict.
    weights
        NAME=PATH: a tracker and the file or folder of its weights. Repeat for further trackers.
    template_memory
        Take further templates of the targets, after THOR. It and distractors do not change trackers
        without networks.
    distractors
        Recognize objects like the target by their positions. By default only lite does.
    protocol
        vot restarts the tracker five frames after a failure, ope never restarts it, realtime is vot
        at 20 frames per second: a tracker that is too slow misses frames.
    preset_name
        Run what a table of the paper needs: table1, table2, table3 or table4. Replaces --stabilize.
    shake
        Comma-separated strengths of a synthetic shake, as shares of the image width, such as
        0,0.01,0.03; 0 is the unmodified footage. Results are written to
        OUT/shake-KIND-STRENGTH-seedN/, with a shake.json that ssiam eval reads.
    shake_kind
        Comma-separated kinds of shake: white, handheld, vibration, gusts, roll, zoom.
    shake_seeds
        Number of camera paths per kind and strength, with seeds 0, 1, ...
    shake_exposure
        Motion blur: share of the frame interval, 0 to 1, during which the shutter is open.
    shake_readout
        Rolling shutter: share of the frame interval, 0 to 1, from the first row to the last.
    shake_border
        Content beyond the image edges: reflect mirrors the image; crop uses a smaller part of the
        image, which stays inside.
    jobs
        Number of parallel runs, each in its own process.
    cluster
        Address of a Dask scheduler to run on instead, such as tcp://10.0.0.1:8786.
    runtime
        Library that runs the networks. It, device and precision do not change trackers without
        networks.
    device
        Device that runs the networks, by default the CPU.
    precision
        Precision of the networks' arithmetic.
    threads
        CPU threads per run.
    """
    if not (1 <= jobs <= max_threads() and 1 <= threads <= max_threads()):
        raise ArgumentError(f"--jobs {jobs} --threads {threads}: both must be 1 to {max_threads()}")
    options = RuntimeOptions(runtime, threads, precision, device)
    if not dataset:
        raise ArgumentError("no dataset: give its folder, such as ssiam bench data/VOT2018")
    paths = parse_weights(weights or [], named_classes=True)
    check_results_folder(out, dataset, paths.values())
    shakes = parse_shakes(
        shake, shake_kind, shake_seeds, shake_exposure, shake_readout, shake_border
    )
    names = None if trackers is None else split_words(trackers)
    if preset_name is not None and (template_memory or distractors is not None):
        raise ArgumentError(
            f"--preset {preset_name}: the paper's tables have neither --template-memory nor "
            "--distractors; leave them out"
        )
    opened = [open_dataset(path) for path in dataset]
    _check_names(dataset, opened)
    if preset_name is not None:
        titles = [each.name for each in opened]
        chosen = preset(check_choice("preset", preset_name, PRESETS), names, paths, titles, options)
        competitors = chosen.entries
        for line in chosen.missing:
            print(f"missing: {line}")
    else:
        methods = [check_choice("stabilize", word, METHODS) for word in split_words(stabilize)]
        competitors = entries(
            names or ["csrt"],
            methods,
            paths,
            options,
            template_memory=template_memory,
            distractors=distractors,
            named_classes=True,
        )
    planned = [
        task
        for path, each in zip(dataset, opened, strict=True)
        for task in tasks(competitors, each, path, out, protocol, shakes)
    ]
    with _Scoreboard(planned) as board:
        for done in run_all(planned, jobs, cluster):
            board.add(done)
    board.print(out)


def _check_names(paths: Sequence[Path], opened: Sequence[Dataset]) -> None:
    """Refuse datasets with sequences of the same name, whose results would be the same files."""
    holders: dict[str, Path] = {}
    for path, each in zip(paths, opened, strict=True):
        for name in each.sequences:
            if name in holders:
                raise ArgumentError(
                    f"{holders[name]} and {path} both have a sequence {name!r}, and results are "
                    "named by sequence; run them one at a time, each with an --out of its own"
                )
            holders[name] = path


class _Scoreboard:
    """A table with one row per tracker and strength of shake, live on standard error."""

    def __init__(self, planned: Sequence[Task]) -> None:
        self._total = Counter(_row_key(task.label, task.shake) for task in planned)
        self._done: dict[_RowKey, list[TaskResult]] = {key: [] for key in self._total}
        self._has_shake = any(task.shake is not None for task in planned)
        self._restarts = any(task.protocol != "ope" for task in planned)
        console = Console(file=sys.stderr)
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._is_live = console.is_terminal

    def __enter__(self) -> _Scoreboard:
        if self._is_live:
            self._live.start()
        return self

    def __exit__(self, *exc: object) -> None:
        if self._is_live:
            self._live.stop()

    def add(self, done: TaskResult) -> None:
        """Count a finished run."""
        self._done[_row_key(done.label, done.shake)].append(done)
        if self._is_live:
            self._live.update(self._table(), refresh=True)

    def print(self, out: Path) -> None:
        """Print the table, and the failed runs with their reasons.

        Raises
        ------
        IncompleteError
            Some runs failed; the message names the first one.
        """
        width = None if sys.stdout.isatty() else _FILE_WIDTH
        Console(width=width).print(self._table())
        failed = [done for runs in self._done.values() for done in runs if done.failed]
        for done in failed:
            print(f"no result: {_failure_line(done)}")
        print(f"results: {out}")
        if failed:
            raise IncompleteError(
                f"{len(failed)} of {sum(self._total.values())} runs have no result; start the "
                f"command again to retry them; the first: {_failure_line(failed[0])}"
            )

    def _table(self) -> Table:
        return self._table_with_shake() if self._has_shake else self._table_without_shake()

    def _table_without_shake(self) -> Table:
        lost = ["lost"] if self._restarts else []
        table = Table("tracker", "sequences", *lost, "overlap", "frames per second")
        for (label, strength), runs in self._done.items():
            found = _Totals(runs)
            table.add_row(
                label,
                f"{found.runs} of {self._total[label, strength]}",
                *([str(found.lost)] if self._restarts else []),
                found.overlap,
                f"{1 / found.seconds_per_frame:.0f}" if found.seconds_per_frame else "",
            )
        return table

    def _table_with_shake(self) -> Table:
        lost = ["lost"] if self._restarts else []
        table = Table("tracker", "shake", "runs", "frames", *lost, "overlap", "ms per frame")
        for (label, strength), runs in self._done.items():
            found = _Totals(runs)
            table.add_row(
                label,
                f"{100 * strength:g} %",
                f"{found.runs} of {self._total[label, strength]}",
                str(found.frames),
                *([str(found.lost)] if self._restarts else []),
                found.overlap,
                f"{1000 * found.seconds_per_frame:.1f}" if found.seconds_per_frame else "",
            )
        return table


class _Totals:
    """Totals over the runs of a row, without the failed ones."""

    def __init__(self, done: Sequence[TaskResult]) -> None:
        finished = [run for run in done if not run.failed]
        timed = [run for run in finished if run.seconds]
        overlaps = [run.overlap for run in finished if np.isfinite(run.overlap)]
        tracked = sum(run.frames for run in timed)
        self.runs = len(finished)
        self.frames = sum(run.frames for run in finished)
        self.lost = sum(run.lost for run in finished)
        self.overlap = f"{np.mean(overlaps):.3f}" if overlaps else ""
        # 0 if no run was timed
        self.seconds_per_frame = sum(run.seconds for run in timed) / tracked if tracked else 0.0


def _failure_line(done: TaskResult) -> str:
    """A failed run and the reason."""
    shake = f", shake {done.shake.label}" if done.shake is not None else ""
    return f"{done.label} on {done.sequence}{shake}: {done.failed}"


def _row_key(label: str, shake: Shake | None) -> _RowKey:
    return label, shake.strength if shake else 0.0
