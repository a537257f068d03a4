"""The shake leaderboard: trackers with and without stabilization, under shake, on two datasets.

    python benchmarks/leaderboard/run.py --out runs/leaderboard --jobs 2
    python benchmarks/leaderboard/run.py --out runs/leaderboard --report

Runs `ssiam bench` on the ten test sequences and on the reserve, with restarts (VOT) and in one pass
(OTB), and keeps its result files:

    OUT/raw/DATASET/TRACKER-STABILIZE/baseline/SEQUENCE/SEQUENCE_001.txt       VOT, with restarts
    OUT/raw/DATASET/TRACKER-STABILIZE/ope/SEQUENCE.txt                         OTB, one pass
    OUT/raw/DATASET/shake-KIND-STRENGTH-seedN/TRACKER-STABILIZE/...            the same, shaken

The one-pass results of lite, whose boxes are rotated, are in VOT's form (unsupervised/, not ope/).
They can be checked with any program that reads these forms; `ssiam bench` of the same version makes
the same shaken frames. Then the page is written: tables.md, tables.html, and plots. Runs that are
finished are not repeated. Needs the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from typing import Final

from ssiam.datasets.shake.path import SHAKE_KINDS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import RESERVE, SEQUENCES, WEIGHTS, nanotrack_weights
from benchmarks.leaderboard.page import write_leaderboard

_DATASETS: Final = {"test sequences": SEQUENCES, "reserve": RESERVE}
_NANOTRACK: Final = ("nanotrack_v1", "nanotrack_v2", "nanotrack_v3")
TRACKERS: Final = ("lite", *_NANOTRACK, "fear_xs", "csrt", "kcf", "mil")
_STABILIZE: Final = ("off", "paper", "predict")
_PROTOCOLS: Final = ("vot", "ope")


def bench_words(chosen: argparse.Namespace, dataset: Path, protocol: str) -> list[str]:
    """The arguments of `ssiam bench` for a dataset and protocol."""
    weights = {name: nanotrack_weights(name) for name in _NANOTRACK}
    weights["fear_xs"] = WEIGHTS / "fear_xs"
    given = [f"{name}={path}" for name, path in weights.items() if name in chosen.trackers]
    return [
        *("bench", str(dataset), "--out", str(chosen.out / "raw" / dataset.name)),
        *("--trackers", ",".join(chosen.trackers), "--stabilize", ",".join(chosen.stabilize)),
        *("--shake", ",".join(f"{each:g}" for each in chosen.strengths)),
        *("--shake-kind", ",".join(chosen.kinds), "--shake-seeds", str(chosen.seeds)),
        *("--protocol", protocol, "--jobs", str(chosen.jobs)),
        *(word for each in given for word in ("--weights", each)),
    ]


def main() -> None:
    """Execute the missing runs and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of results and page")
    parser.add_argument("--trackers", nargs="+", default=TRACKERS, choices=TRACKERS)
    parser.add_argument("--datasets", nargs="+", default=list(_DATASETS), choices=_DATASETS)
    parser.add_argument("--stabilize", nargs="+", default=_STABILIZE, choices=_STABILIZE)
    parser.add_argument("--protocols", nargs="+", default=_PROTOCOLS, choices=_PROTOCOLS)
    parser.add_argument("--strengths", nargs="+", type=float, default=(0.0, 0.01, 0.03, 0.05))
    parser.add_argument("--kinds", nargs="+", default=("white", "handheld"), choices=SHAKE_KINDS)
    parser.add_argument("--seeds", type=int, default=1, help="number of paths of each shake")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--report", action="store_true", help="only write the page")
    chosen = parser.parse_args()
    datasets = {name: _DATASETS[name] for name in chosen.datasets}
    if not chosen.report:
        for dataset in datasets.values():
            for protocol in chosen.protocols:
                words = bench_words(chosen, dataset, protocol)
                done = subprocess.run([sys.executable, "-m", "ssiam", *words])
                if done.returncode == 2:  # 3: a run failed, and the others are there
                    sys.exit(2)
    for path in write_leaderboard(chosen.out, datasets):
        print(path)


if __name__ == "__main__":
    main()
