"""`ssiam bench`: many trackers over many sequences."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from ssiam.cli.arguments import weights_by_tracker, words
from ssiam.cli.scoreboard import Scoreboard
from ssiam.datasets import open_dataset
from ssiam.errors import ArgumentError, check_choice
from ssiam.evaluation.bench import run_all, tasks
from ssiam.evaluation.entries import entries
from ssiam.evaluation.presets import PRESETS, preset
from ssiam.evaluation.protocols import ProtocolName
from ssiam.stabilize import METHODS

_WHAT = Group("What is run", sort_key=1)
_HOW = Group("How it is run", sort_key=2)


def bench(
    *dataset: Path,
    out: Annotated[Path, Parameter(group=_WHAT)],
    trackers: Annotated[str | None, Parameter(group=_WHAT)] = None,
    stabilize: Annotated[str, Parameter(group=_WHAT)] = "off,paper",
    weights: Annotated[list[str] | None, Parameter(group=_WHAT, negative=())] = None,
    protocol: Annotated[ProtocolName, Parameter(group=_WHAT)] = "vot",
    preset_name: Annotated[str | None, Parameter(name="--preset", group=_WHAT)] = None,
    jobs: Annotated[int, Parameter(group=_HOW)] = 1,
    threads: Annotated[int, Parameter(group=_HOW)] = 1,
    cluster: Annotated[str | None, Parameter(group=_HOW)] = None,
) -> None:
    """Run trackers over datasets, each with and without steadying.

    A run that is done is never done again: start the same command after an interruption, and it
    goes on where it stopped.

    Parameters
    ----------
    dataset
        Folders of VOT, OTB, UAV123, DTB70, GOT-10k or LaSOT, a VOT2018.json, or a folder of
        sequences.
    out
        Folder of the results: OUT/<tracker>-<stabilize>/baseline/<sequence>/<sequence>_001.txt.
    trackers
        Names, separated by commas; with --preset those that are at hand unless given.
    stabilize
        Ways of steadying, separated by commas: off, paper, literal.
    weights
        NAME=PATH of a tracker's networks. Give it again for each further tracker.
    protocol
        vot starts again five frames after a failure, ope never does, realtime is vot with frames
        dropped by the clock (20 a second).
    preset_name
        The runs behind a table of the paper: table1, table2, table3 or table4.
    jobs
        Runs at a time, each in a process of its own.
    threads
        CPU threads of each run.
    cluster
        Address of a Dask scheduler to run on, such as tcp://10.0.0.1:8786.
    """
    if jobs < 1 or threads < 1:
        raise ArgumentError(f"--jobs {jobs} --threads {threads}: both must be at least 1")
    if not dataset:
        raise ArgumentError("no dataset: give its folder, such as ssiam bench data/VOT2018")
    paths = weights_by_tracker(weights or [])
    names = None if trackers is None else words(trackers)
    if preset_name is not None:
        opened = [open_dataset(path).name for path in dataset]
        chosen = preset(check_choice("preset", preset_name, PRESETS), names, paths, opened)
        competitors = chosen.entries
        for line in chosen.missing:
            print(f"missing: {line}")
    else:
        methods = [check_choice("stabilize", word, METHODS) for word in words(stabilize)]
        competitors = entries(names or ["csrt"], methods, paths)
    todo = [
        task
        for path in dataset
        for task in tasks(competitors, open_dataset(path), path, out, protocol, threads)
    ]
    with Scoreboard(todo) as board:
        for done in run_all(todo, jobs, cluster):
            board.add(done)
    board.show(out)
