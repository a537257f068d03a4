"""How many targets a shaking camera costs, and how many of them each way of steadying keeps.

    python benchmarks/shake/run.py --out runs/shake --one-pass --jobs 2 \
        --trackers nanotrack_v1 nanotrack_v2 nanotrack_v3 kcf csrt \
        --settings off paper literal predict "predict, true motion" --kinds white handheld
    python benchmarks/shake/run.py --out runs/shake --one-pass --jobs 2 --settings all
    python benchmarks/shake/run.py --out runs/shake --report [--plot docs/images/shake.png]

Every run of a tracker on a shaken sequence starts again five frames after the target was lost
(VOT); with --one-pass there is a second one that never does. Each is kept as a small file in
--out and made only once: a benchmark that was stopped goes on where it was; remove the folder when
the code changes. The tables that benchmarks/shake/report.py makes of all runs there are printed at
the end, or at once with --report. "predict, true motion" is told the camera's motion: the shake,
on top of what is estimated on the unshaken frames with the true box left out. "predict without
find" and the like lack one part each. Needs the folder of test data (see shared_data.py).
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from pathlib import Path

import joblib

from ssiam.datasets.camera_paths import SHAKE_KINDS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import sequences
from benchmarks.common.loading import PEERS
from benchmarks.shake.measure import SETTINGS, chunk
from benchmarks.shake.plot import draw
from benchmarks.shake.records import NO_SHAKE, Run, read_runs
from benchmarks.shake.report import MAIN, report

TRACKERS = ("lite", "nanotrack_v1", "nanotrack_v2", "nanotrack_v3", "kcf", "csrt", *PEERS)
STRENGTHS = (0.0, 0.01, 0.03, 0.05)


def chunks(chosen: argparse.Namespace) -> list[list[Run]]:
    """What is not there yet: the runs of a tracker on a sequence under a strength and kind."""
    there = {each.key for each in read_runs(chosen.out) if each.has_one_pass or not chosen.one_pass}
    shakes = [(NO_SHAKE, 0.0, [0])] if 0 in chosen.strengths else []
    shakes += [(k, s, range(chosen.seeds)) for s in chosen.strengths if s for k in chosen.kinds]
    todo = []
    for tracker, (kind, strength, seeds), name in product(
        chosen.trackers, shakes, chosen.sequences
    ):
        own = [
            Run(tracker, setting, kind, strength, seed, name)
            for seed in seeds
            for setting in chosen.settings
        ]
        todo.append([each for each in own if each.key not in there])
    return [own for own in todo if own]


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the runs")
    parser.add_argument("--trackers", nargs="+", default=["nanotrack_v3"], choices=TRACKERS)
    parser.add_argument("--settings", nargs="+", default=MAIN, choices=(*SETTINGS, "all"))
    parser.add_argument("--kinds", nargs="+", default=SHAKE_KINDS, choices=SHAKE_KINDS)
    parser.add_argument("--strengths", nargs="+", type=float, default=STRENGTHS)
    parser.add_argument("--seeds", type=int, default=3, help="how many paths of each shake")
    parser.add_argument("--sequences", nargs="+", help="all of them unless given")
    parser.add_argument("--one-pass", action="store_true", help="one-pass runs too")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--report", action="store_true", help="only the tables of what is there")
    parser.add_argument("--ablate", help="tracker of the second table; default: the first")
    parser.add_argument("--plot", type=Path, help="picture to be drawn")
    chosen = parser.parse_args()
    chosen.ablate = chosen.ablate or chosen.trackers[0]
    chosen.settings = SETTINGS if "all" in chosen.settings else chosen.settings
    return chosen


def main() -> None:
    """Make the runs and print the tables."""
    chosen = arguments()
    if not chosen.report:
        chosen.sequences = chosen.sequences or list(sequences())
        todo = chunks(chosen)
        count, done = sum(map(len, todo)), 0
        calls = (joblib.delayed(chunk)(chosen.out, chosen.one_pass, own) for own in todo)
        parallel = joblib.Parallel(n_jobs=chosen.jobs, return_as="generator_unordered")
        for made in parallel(calls):
            done += made
            print(f"{done} of {count} runs", file=sys.stderr, flush=True)
    runs = read_runs(chosen.out)
    print(report(runs, chosen.ablate))
    if chosen.plot:
        draw(runs, chosen.plot)


if __name__ == "__main__":
    main()
