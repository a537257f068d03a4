"""Lost targets under synthetic camera shake, for each stabilization method.

    python benchmarks/shake/run.py --out runs/shake --one-pass --jobs 2 \
        --trackers nanotrack_v1 nanotrack_v2 nanotrack_v3 kcf csrt \
        --settings off paper literal predict "predict, true motion" --kinds white handheld
    python benchmarks/shake/run.py --out runs/shake --one-pass --jobs 2 --settings all
    python benchmarks/shake/run.py --out runs/shake --report [--plot docs/images/shake.png]

Each run restarts the tracker five frames after a lost target (VOT); --one-pass adds a second run
without restarts. The result of each run is a small file in --out. An interrupted benchmark resumes
and does not repeat finished runs; remove the folder when the code changes. The tables of all runs
in the folder (benchmarks/shake/report.py) are printed at the end, or immediately with --report.
"predict, true motion" receives the camera motion: the shake combined with the estimate on the
unshaken frames with the true box excluded. "predict without find" and the like disable one part of
predict; "predict, homography" and the like have another model of the camera motion, and are not
part of "all". --data reads the sequences of another folder. Needs the folder of test data (see
benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from itertools import product
from pathlib import Path

import joblib

from ssiam.datasets.shake.path import SHAKE_KINDS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import SEQUENCES, sequences
from benchmarks.shake.measure import SETTINGS, run_all
from benchmarks.shake.plot import draw
from benchmarks.shake.records import NO_SHAKE, ShakeRun, read_runs
from benchmarks.shake.report import MAIN, MODELS, report

TRACKERS = ("lite", "nanotrack_v1", "nanotrack_v2", "nanotrack_v3", "kcf", "csrt", "fear_xs")
STRENGTHS = (0.0, 0.01, 0.03, 0.05)


def missing_runs(chosen: argparse.Namespace) -> list[list[ShakeRun]]:
    """Runs without a file, grouped by tracker, kind and strength of shake, and sequence."""
    finished = {
        each.key for each in read_runs(chosen.out) if each.has_one_pass or not chosen.one_pass
    }
    no_shake: list[tuple[str, float, Iterable[int]]] = [(NO_SHAKE, 0.0, [0])]
    shakes = no_shake if 0 in chosen.strengths else []
    shakes += [(k, s, range(chosen.seeds)) for s in chosen.strengths if s for k in chosen.kinds]
    groups = []
    for tracker, (kind, strength, seeds), name in product(
        chosen.trackers, shakes, chosen.sequences
    ):
        group = [
            ShakeRun(tracker, setting, kind, strength, seed, name)
            for seed in seeds
            for setting in chosen.settings
        ]
        groups.append([each for each in group if each.key not in finished])
    return [group for group in groups if group]


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--trackers", nargs="+", default=["nanotrack_v3"], choices=TRACKERS)
    parser.add_argument("--settings", nargs="+", default=MAIN, choices=(*SETTINGS, *MODELS, "all"))
    parser.add_argument("--kinds", nargs="+", default=SHAKE_KINDS, choices=SHAKE_KINDS)
    parser.add_argument("--strengths", nargs="+", type=float, default=STRENGTHS)
    parser.add_argument("--seeds", type=int, default=3, help="number of paths of each shake")
    parser.add_argument("--data", type=Path, default=SEQUENCES, help="folder of the sequences")
    parser.add_argument("--sequences", nargs="+", help="default: all")
    parser.add_argument("--one-pass", action="store_true", help="with one-pass runs")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--report", action="store_true", help="only print the tables")
    parser.add_argument("--ablate", help="tracker of the last table; default: the first one")
    parser.add_argument("--plot", type=Path, help="file of the plot")
    chosen = parser.parse_args()
    chosen.ablate = chosen.ablate or chosen.trackers[0]
    chosen.settings = SETTINGS if "all" in chosen.settings else chosen.settings
    return chosen


def main() -> None:
    """Execute the missing runs and print the tables."""
    chosen = arguments()
    if not chosen.report:
        chosen.sequences = chosen.sequences or list(sequences(chosen.data))
        groups = missing_runs(chosen)
        count, finished = sum(map(len, groups)), 0
        calls = (
            joblib.delayed(run_all)(chosen.out, chosen.data, chosen.one_pass, group)
            for group in groups
        )
        parallel = joblib.Parallel(n_jobs=chosen.jobs, return_as="generator_unordered")
        for number in parallel(calls):
            finished += number
            print(f"{finished} of {count} runs", file=sys.stderr, flush=True)
    runs = read_runs(chosen.out)
    print(report(runs, chosen.ablate))
    if chosen.plot:
        draw(runs, chosen.plot)


if __name__ == "__main__":
    main()
