"""`ssiam bench`: many trackers over many sequences."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from ssiam.cli.arguments import check_results_folder, shakes, weights_by_tracker, words
from ssiam.cli.scoreboard import Scoreboard
from ssiam.datasets import ShakeBorder, open_dataset
from ssiam.errors import ArgumentError, check_choice
from ssiam.evaluation.paper.presets import PRESETS, preset
from ssiam.evaluation.runs.bench import run_all, tasks
from ssiam.evaluation.runs.entries import entries
from ssiam.evaluation.runs.protocols import ProtocolName
from ssiam.stabilize import METHODS

_WHAT = Group("What is run", sort_key=1)
_SHAKEN = Group("How it is shaken", sort_key=2)
_HOW = Group("How it is run", sort_key=3)


def bench(
    *dataset: Path,
    out: Annotated[Path, Parameter(group=_WHAT)],
    trackers: Annotated[str | None, Parameter(group=_WHAT)] = None,
    stabilize: Annotated[str, Parameter(group=_WHAT)] = "off,paper,predict",
    weights: Annotated[list[str] | None, Parameter(group=_WHAT, negative=())] = None,
    protocol: Annotated[ProtocolName, Parameter(group=_WHAT)] = "vot",
    preset_name: Annotated[str | None, Parameter(name="--preset", group=_WHAT)] = None,
    shake: Annotated[str, Parameter(group=_SHAKEN)] = "0",
    shake_kind: Annotated[str, Parameter(group=_SHAKEN)] = "white",
    shake_seeds: Annotated[int, Parameter(group=_SHAKEN)] = 1,
    shake_exposure: Annotated[float, Parameter(group=_SHAKEN)] = 0.0,
    shake_readout: Annotated[float, Parameter(group=_SHAKEN)] = 0.0,
    shake_border: Annotated[ShakeBorder, Parameter(group=_SHAKEN)] = "reflect",
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
        Folders of VOT, OTB, UAV123, DTB70, GOT-10k, LaSOT or MOTChallenge, a VOT2018.json, or a
        folder of sequences.
    out
        Folder of the results: OUT/TRACKER-STABILIZE/baseline/SEQUENCE/SEQUENCE_001.txt.
    trackers
        Names, separated by commas; with --preset those that are at hand unless given.
    stabilize
        Ways of steadying, separated by commas: off, paper, literal, predict.
    weights
        NAME=PATH of a tracker's networks. Give it again for each further tracker.
    protocol
        vot starts again five frames after a failure, ope never does, realtime is vot with frames
        dropped by the clock (20 a second).
    preset_name
        The runs behind a table of the paper: table1, table2, table3 or table4.
    shake
        Strengths of a shake that is added to the footage, separated by commas: shares of the
        picture's width, such as 0,0.01,0.03; 0 is the footage as it is. Shaken results lie in
        OUT/shake-KIND-STRENGTH-seedN/, with a shake.json that ssiam eval reads.
    shake_kind
        Kinds of shake, separated by commas: white, handheld, vibration, gusts, roll, zoom.
    shake_seeds
        Paths of each kind and strength, with the seeds 0, 1, ...
    shake_exposure
        Motion blur: share of the frame interval, 0 to 1, during which the shutter is open.
    shake_readout
        Rolling shutter: share of the frame interval, 0 to 1, from the first row to the last.
    shake_border
        What is seen beyond the picture: reflect shows its mirror image; crop shows a smaller
        window of the picture, which never leaves it.
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
    check_results_folder(out, dataset, paths.values())
    shaken_by = shakes(shake, shake_kind, shake_seeds, shake_exposure, shake_readout, shake_border)
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
        for task in tasks(competitors, open_dataset(path), path, out, protocol, threads, shaken_by)
    ]
    with Scoreboard(todo) as board:
        for done in run_all(todo, jobs, cluster):
            board.add(done)
    board.show(out)
