"""Success and lost targets on the sequences of a folder, the reserve unless another is given.

    python benchmarks/accuracy/reserve.py [--trackers lite nanotrack_v3 fear_xs] [--settings predict off]
        [--data FOLDER] [--strengths 0.03 0.05] [--kinds white handheld] [--seeds 3] [--verbose]

The ten sequences of the reserve choose nothing: no number, weight or design. Success is that of
one pass; lost targets are those of a second run that starts again five frames after each loss, as
in VOT and as benchmarks/shake/run.py counts them. With --strengths the footage is shaken too, by paths
of several seeds; figures are then means over the kinds, with the least and the greatest of the
seeds. The difference to the first tracker with the same setting has a bootstrap 95 % interval over
the sequences. Needs the folder of test data (see shared_data.py). A tracker may have weights of its
own: lite=runs/mine.
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
from ssiam.datasets.camera_paths import SHAKE_KINDS
from ssiam.evaluation.measures.compare import paired_difference
from ssiam.stabilize import METHODS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import RESERVE, sequences
from benchmarks.common.loading import load
from benchmarks.shake.measure import film, measured
from benchmarks.shake.records import NO_SHAKE, Run

TRACKERS = ("lite", "nanotrack_v3", "fear_xs")
HEAD = "| tracker | shake | success | difference | lost | reported lost |"


def runs(chosen: argparse.Namespace) -> list[Run]:
    """Every tracker with every setting on every sequence, as it is and shaken."""
    loaded = {each: load(*each) for each in product(chosen.trackers, chosen.settings)}
    paths = [(NO_SHAKE, 0.0, 0)]
    paths += list(product(chosen.kinds, chosen.strengths, range(chosen.seeds)))
    found = []
    for plain, (kind, strength, seed) in product(sequences(chosen.data).values(), paths):
        shake = Shake(strength, kind, seed) if strength else None
        filmed = film(plain if shake is None else shaken(plain, shake))
        for (name, setting), tracker in loaded.items():
            run = Run(name, setting, kind, strength, seed, plain.name)
            found.append(measured(run, True, tracker, filmed, None))
        print(f"{plain.name} {kind} {strength:g} {seed}", file=sys.stderr, flush=True)
    return found


def row(own: list[Run], first: list[Run]) -> str:
    """A line of the table: the runs of a tracker with a setting under a shake."""
    seeds = sorted({each.seed for each in own})
    by_seed = [[each for each in own if each.seed == seed] for seed in seeds]
    successes = [float(np.mean([success(each) for each in runs])) for runs in by_seed]
    kinds = len({each.kind for each in own})
    lost = [sum(each.lost for each in runs) / kinds for runs in by_seed]
    reported = sum(each.one_pass_told_lost for each in own) / sum(each.frames for each in own)
    shake = "none" if own[0].kind == NO_SHAKE else f"{100 * own[0].strength:g} %"
    cells = (
        f"{own[0].tracker} {own[0].setting}",
        shake,
        spread(successes, "{:.3f}"),
        difference(own, first),
        spread(lost, "{:g}"),
        f"{100 * reported:.1f} %",
    )
    return "| " + " | ".join(cells) + " |"


def spread(values: list[float], form: str) -> str:
    """The mean of the seeds, with the least and the greatest."""
    mean = form.format(round(float(np.mean(values)), 3))
    if len(values) == 1:
        return mean
    return f"{mean} ({form.format(min(values))} to {form.format(max(values))})"


def success(run: Run) -> float:
    """Success of the one-pass run, which there is."""
    assert run.success is not None
    return run.success


def difference(own: list[Run], first: list[Run]) -> str:
    """Of the success to that of the first tracker, sequence by sequence."""
    if own[0].tracker == first[0].tracker:
        return ""
    ours, theirs = (by_sequence(runs) for runs in (own, first))
    paired = paired_difference(ours, theirs)
    return f"{paired.value:+.3f} [{paired.low:+.3f}, {paired.high:+.3f}]"


def by_sequence(runs: list[Run]) -> dict[str, float]:
    """Mean success of each sequence."""
    names = dict.fromkeys(each.sequence for each in runs)
    return {
        name: float(np.mean([success(each) for each in runs if each.sequence == name]))
        for name in names
    }


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trackers", nargs="+", default=TRACKERS)
    parser.add_argument("--settings", nargs="+", default=["predict", "off"], choices=METHODS)
    parser.add_argument("--data", type=Path, default=RESERVE, help="folder of the sequences")
    parser.add_argument("--strengths", nargs="*", type=float, default=[], help="of a shake")
    parser.add_argument("--kinds", nargs="+", default=SHAKE_KINDS[:2], choices=SHAKE_KINDS)
    parser.add_argument("--seeds", type=int, default=3, help="how many paths of each shake")
    parser.add_argument("--verbose", action="store_true", help="a line for every run")
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    chosen = arguments()
    cv2.setNumThreads(1)
    found = runs(chosen)
    print(f"    python benchmarks/accuracy/reserve.py {shlex.join(sys.argv[1:])}\n")
    for each in found if chosen.verbose else ():
        print(
            f"{each.tracker} {each.setting} {each.sequence} {each.kind} {each.strength:g} "
            f"{each.seed}: success {success(each):.3f}, lost {each.lost}, "
            f"reported lost {each.one_pass_told_lost} of {each.frames}"
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
