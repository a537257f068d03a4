"""`ssiam tune`: search stabilization parameters for given footage."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ssiam.cli.options import RUNTIME_GROUP, check_results_folder, parse_weights, split_words
from ssiam.errors import ArgumentError, check_choice
from ssiam.evaluation import parameters
from ssiam.evaluation.runs.entries import changed_runtime, options_for
from ssiam.evaluation.tuning import FinishedTrial, Search
from ssiam.evaluation.tuning import tune as tried_configs
from ssiam.runtime import DeviceName, Precision, RuntimeName, RuntimeOptions
from ssiam.trackers import TRACKERS


def tune(
    dataset: Path,
    /,
    *,
    trackers: str,
    out: Path,
    stabilize: parameters.SearchedMethod = "predict",
    trials: int = 50,
    jobs: int = 1,
    weights: Annotated[list[str] | None, Parameter(negative=())] = None,
    parameter: Annotated[list[str] | None, Parameter(negative=())] = None,
    seed: int = 0,
    runtime: Annotated[RuntimeName, Parameter(group=RUNTIME_GROUP)] = "openvino",
    device: Annotated[DeviceName | None, Parameter(group=RUNTIME_GROUP)] = None,
    precision: Annotated[Precision, Parameter(group=RUNTIME_GROUP)] = "f32",
    threads: Annotated[int, Parameter(group=RUNTIME_GROUP)] = 1,
) -> None:
    """Search for the stabilization parameters that lose the fewest targets.

    Each trial runs the trackers over the whole dataset, with a restart five frames after each
    loss. The best trial has the fewest lost targets and, among equals, the largest mean overlap.
    The first trial uses the defaults of the method. After an interruption, start the same command
    again to continue; increase --trials to extend the search. The sequences that choose do not
    measure the result: take others for that.

    Parameters
    ----------
    dataset
        Folder or file of a dataset, as for ssiam bench.
    trackers
        Comma-separated names of trackers; their lost targets are summed.
    out
        Folder for Optuna's study.db and the results of all runs.
    stabilize
        Method whose settings are searched.
    trials
        Number of trials, including those of earlier runs of this command.
    jobs
        Number of parallel runs within a trial, each in its own process.
    weights
        NAME=PATH: a tracker and the file or folder of its weights. Repeat for further trackers.
    parameter
        Parameter to search, NAME=LOW:HIGH or NAME=WORD,WORD, such as margin=0:0.5, turn=true,false
        or keypoints=orb,direct. Repeat for further parameters. By default, for predict,
        memory=0:0.95, smoothing=0:0.95 and margin=0:0.5; for paper and literal the thresholds of
        the paper's Table 3, thx1=20:120, thx2=5:100 and tha=0.05:1. Unless they are searched
        themselves, thy1 and thy2 are half of thx1 and thx2.
    seed
        Random seed of the search.
    runtime
        Library that runs the networks. A search continues only with the same runtime, device,
        precision, threads and weights.
    device
        Device that runs the networks, by default the CPU.
    precision
        Precision of the networks' arithmetic.
    threads
        CPU threads per run.
    """
    if trials < 1 or jobs < 1:
        raise ArgumentError(f"--trials {trials} --jobs {jobs}: both must be at least 1")
    options = RuntimeOptions(runtime, threads, precision, device)
    names = tuple(check_choice("tracker", word, TRACKERS) for word in split_words(trackers))
    if not names:
        raise ArgumentError(f"--trackers {trackers!r}: give at least one name")
    search_space = tuple(
        parameters.Parameter.parse(text)
        for text in parameter or parameters.SEARCH_SPACES[stabilize]
    )
    counts = Counter(each.name for each in search_space)
    for name, count in counts.items():
        if count > 1:
            raise ArgumentError(f"--parameter {name} is given twice: give each name once")
    paths = parse_weights(weights or [])
    check_results_folder(out, [dataset], paths.values())
    search = Search(dataset, names, search_space, out, paths, seed, options, stabilize)
    best: FinishedTrial | None = None
    for tried in tried_configs(search, trials, jobs):
        best = tried if best is None or tried.cost < best.cost else best
        print(f"trial {tried.number}: {_trial_summary(tried)}", flush=True)
    if best is not None:
        _print_best(best, search)


def _trial_summary(tried: FinishedTrial) -> str:
    flags = parameters.track_flags(tried.config)
    return f"{tried.lost} lost, overlap {tried.overlap:.4f}, {flags}"


def _print_best(best: FinishedTrial, search: Search) -> None:
    print(f"best: trial {best.number}, {best.lost} lost, overlap {best.overlap:.4f}")
    for name in search.trackers:
        weights = f" --weights {search.weights[name]}" if name in search.weights else ""
        flags = parameters.track_flags(best.config)
        runtime = "".join(
            f" --{option} {value}"
            for option, value in changed_runtime(options_for(name, search.options)).items()
        )
        print(f"  ssiam track SOURCE --box X,Y,W,H --tracker {name}{weights} {flags}{runtime}")
    names = search.sequences
    print(f"chosen on {', '.join(names)}: measure it on other sequences than these {len(names)}")
