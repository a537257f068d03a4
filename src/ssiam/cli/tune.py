"""`ssiam tune`: search the numbers of the steadying that suit one's own footage."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ssiam.cli.arguments import check_results_folder, weights_by_tracker, words
from ssiam.errors import ArgumentError, check_choice
from ssiam.evaluation import parameters
from ssiam.evaluation.tuning import FinishedTrial, Search
from ssiam.evaluation.tuning import tune as tried_configs
from ssiam.trackers import TRACKERS


def tune(
    dataset: Path,
    /,
    *,
    trackers: str,
    out: Path,
    trials: int = 50,
    jobs: int = 1,
    weights: Annotated[list[str] | None, Parameter(negative=())] = None,
    parameter: Annotated[list[str] | None, Parameter(negative=())] = None,
    seed: int = 0,
) -> None:
    """Search the numbers of the steadying with which the fewest targets are lost.

    Each trial runs the trackers over the whole dataset, restarted five frames after each loss.
    Fewer lost targets win; where as many are lost, the larger mean overlap. The first trial has
    the paper's numbers. Start the same command after an interruption, and it goes on where it
    stopped; with more --trials it goes further.

    Parameters
    ----------
    dataset
        Folder or file of a dataset, as for ssiam bench.
    trackers
        Names, separated by commas; their lost targets are added up.
    out
        Folder of study.db, Optuna's record, and of the results of all runs.
    trials
        Trials, those of earlier runs of this command included.
    jobs
        Runs of a trial at a time, each in a process of its own.
    weights
        NAME=PATH of a tracker's networks. Give it again for each further tracker.
    parameter
        What is searched, NAME=LOW:HIGH or NAME=WORD,WORD, such as thx1=20:120, window=5:60 or
        keypoints=orb,direct. Give it again for each further one. By default the thresholds of the
        paper's Table 3: thx1=20:120, thx2=5:100 and tha=0.05:1. Unless they are searched
        themselves, thy1 and thy2 are half of thx1 and thx2.
    seed
        Another seed tries other values.
    """
    if trials < 1 or jobs < 1:
        raise ArgumentError(f"--trials {trials} --jobs {jobs}: both must be at least 1")
    names = tuple(check_choice("tracker", word, TRACKERS) for word in words(trackers))
    if not names:
        raise ArgumentError(f"--trackers {trackers!r}: give at least one name")
    searched = tuple(parameters.Parameter.parse(text) for text in parameter or parameters.TABLE_3)
    if len({each.name for each in searched}) < len(searched):
        raise ArgumentError("a --parameter is given twice: give each name once")
    paths = weights_by_tracker(weights or [])
    check_results_folder(out, [dataset], paths.values())
    search = Search(dataset, names, searched, out, paths, seed)
    best: FinishedTrial | None = None
    for tried in tried_configs(search, trials, jobs):
        best = tried if best is None or tried.cost < best.cost else best
        print(f"trial {tried.number}: {_told(tried)}", flush=True)
    if best is not None:
        _show(best, search)


def _told(tried: FinishedTrial) -> str:
    flags = parameters.track_flags(tried.config)
    return f"{tried.lost} lost, overlap {tried.overlap:.4f}, {flags}"


def _show(best: FinishedTrial, search: Search) -> None:
    print(f"best: trial {best.number}, {best.lost} lost, overlap {best.overlap:.4f}")
    for name in search.trackers:
        weights = f" --weights {search.weights[name]}" if name in search.weights else ""
        flags = parameters.track_flags(best.config)
        print(f"  ssiam track SOURCE --box X,Y,W,H --tracker {name}{weights} {flags}")
