"""Success and lost targets on the sequences of a folder, by default the reserve.

    python benchmarks/accuracy/reserve.py [--trackers lite nanotrack_v3 fear_xs]
        [--settings predict off] [--data FOLDER] [--strengths 0.03 0.05]
        [--kinds white handheld] [--seeds 3] [--verbose]

The ten sequences of the reserve are only reported; no parameter, weight or design was chosen on
them. Success is that of one pass. Lost targets are those of a second run that restarts the tracker
five frames after each loss, as in VOT and in benchmarks/shake/run.py. With --strengths the footage
is also shaken, by paths of several seeds; figures are then means over the kinds, with the minimum
and maximum over the seeds. The difference from the first tracker with the same setting has a
bootstrap 95 % interval over the sequences. Needs the folder of test data (see
benchmarks/common/data.py). A tracker may have a folder of weights: lite=runs/mine.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from itertools import product
from pathlib import Path

import cv2
import numpy as np

from ssiam.datasets import Shake, shaken
from ssiam.datasets.shake.path import SHAKE_KINDS
from ssiam.errors import check_choice
from ssiam.evaluation.measures.compare import paired_difference
from ssiam.stabilize import METHODS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import RESERVE, sequences
from benchmarks.common.loading import load
from benchmarks.common.tables import line, spread
from benchmarks.shake.measure import cached, measured
from benchmarks.shake.records import NO_SHAKE, ShakeRun

TRACKERS = ("lite", "nanotrack_v3", "fear_xs")
HEAD = "| tracker | shake | success | difference | lost | reported lost |"


def runs(chosen: argparse.Namespace) -> list[ShakeRun]:
    """Run every tracker with every setting on every sequence, unshaken and shaken."""
    loaded = {each: load(*each) for each in product(chosen.trackers, chosen.settings)}
    paths: list[tuple[str, float, int]] = [(NO_SHAKE, 0.0, 0)]
    paths += product(chosen.kinds, chosen.strengths, range(chosen.seeds))
    found = []
    for unshaken, path in product(sequences(chosen.data).values(), paths):
        kind, strength, seed = path
        sequence = unshaken
        if strength:
            shake = Shake(strength, check_choice("kind", kind, SHAKE_KINDS), seed)
            sequence = shaken(unshaken, shake)
        frames = cached(sequence)
        for (name, setting), tracker in loaded.items():
            run = ShakeRun(name, setting, *path, unshaken.name)
            found.append(measured(run, True, tracker, frames, None))
        print(f"{unshaken.name} {kind} {strength:g} {seed}", file=sys.stderr, flush=True)
    return found


def row(own: list[ShakeRun], first: list[ShakeRun]) -> str:
    """A line of the table: the runs of a tracker with a setting under a shake."""
    seeds = sorted({each.seed for each in own})
    by_seed = [[each for each in own if each.seed == seed] for seed in seeds]
    successes = [float(np.mean([success(each) for each in runs])) for runs in by_seed]
    kinds = len({each.kind for each in own})
    lost = [sum(each.lost for each in runs) / kinds for runs in by_seed]
    reported = sum(each.one_pass_reported_lost for each in own) / sum(each.frames for each in own)
    shake = "none" if own[0].kind == NO_SHAKE else f"{100 * own[0].strength:g} %"
    cells = (
        f"{own[0].tracker} {own[0].setting}",
        shake,
        spread(successes, "{:.3f}"),
        difference(own, first),
        spread(lost, "{:g}"),
        f"{100 * reported:.1f} %",
    )
    return line(cells)


def success(run: ShakeRun) -> float:
    """Success of the one-pass run."""
    assert run.success is not None
    return run.success


def difference(own: list[ShakeRun], first: list[ShakeRun]) -> str:
    """Difference of success from the first tracker, paired by sequence."""
    if own[0].tracker == first[0].tracker:
        return ""
    paired = paired_difference(by_sequence(own), by_sequence(first))
    return f"{paired.value:+.3f} [{paired.low:+.3f}, {paired.high:+.3f}]"


def by_sequence(runs: list[ShakeRun]) -> dict[str, float]:
    """Mean success of each sequence."""
    names = dict.fromkeys(each.sequence for each in runs)
    return {
        name: float(np.mean([success(each) for each in runs if each.sequence == name]))
        for name in names
    }


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trackers", nargs="+", default=TRACKERS)
    parser.add_argument("--settings", nargs="+", default=["predict", "off"], choices=METHODS)
    parser.add_argument("--data", type=Path, default=RESERVE, help="folder of the sequences")
    parser.add_argument("--strengths", nargs="*", type=float, default=[], help="of added shake")
    parser.add_argument("--kinds", nargs="+", default=SHAKE_KINDS[:2], choices=SHAKE_KINDS)
    parser.add_argument("--seeds", type=int, default=3, help="number of paths of each shake")
    parser.add_argument("--verbose", action="store_true", help="print a line for every run")
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    chosen = parsed_arguments()
    cv2.setNumThreads(1)
    found = runs(chosen)
    print(f"    python benchmarks/accuracy/reserve.py {shlex.join(sys.argv[1:])}\n")
    for each in found if chosen.verbose else ():
        print(
            f"{each.tracker} {each.setting} {each.sequence} {each.kind} {each.strength:g} "
            f"{each.seed}: success {success(each):.3f}, lost {each.lost}, "
            f"reported lost {each.one_pass_reported_lost} of {each.frames}"
        )
    print(HEAD)
    print("|---" * HEAD.count(" |") + "|")
    for strength, setting in product((0.0, *chosen.strengths), chosen.settings):
        same = [run for run in found if run.strength == strength and run.setting == setting]
        first = [run for run in same if run.tracker == chosen.trackers[0]]
        for name in chosen.trackers:
            print(row([run for run in same if run.tracker == name], first))


if __name__ == "__main__":
    main()
