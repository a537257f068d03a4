"""The parameters of the template memory: success with single changes of its parameters.

    python benchmarks/calibration/template_memory.py [--trackers nanotrack_v2 lite] [--frames 50]

Runs as in benchmarks/accuracy/related.py over the ten test sequences and five targets of
ADL-Rundle-6, shaken by 3 % with one seed. The first row is the tracker without a
memory. Needs the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from ssiam.evaluation.measures.compare import paired_difference
from ssiam.trackers import StabilizedTracker
from ssiam.trackers.template_memory import PARAMETERS, MemoryParameters, TemplateMemoryTracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.accuracy.related import clip_of, one_pass, sequences_of
from benchmarks.common.loading import load
from benchmarks.common.tables import head, line

NONE = "no memory"
CHANGES: dict[str, dict[str, float]] = {
    "defaults": {},
    "a second search in every frame": {"search_below": 1.0},
    "no margin": {"margin": 0.0},
}
SETS = ("sequences", "adl")
STRENGTH = 0.03


def with_memory(tracker: StabilizedTracker, parameters: MemoryParameters) -> StabilizedTracker:
    """A clone of a tracker with a template memory."""
    view_tracker = tracker.clone().view_tracker
    return StabilizedTracker(TemplateMemoryTracker(view_tracker, parameters), tracker.config)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trackers", nargs="+", default=["nanotrack_v2", "lite"])
    parser.add_argument("--frames", type=int, default=50, help="of each sequence, at most")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    prototypes = {}
    for tracker in chosen.trackers:
        base = prototypes[tracker, NONE] = load(tracker)
        for name, changes in CHANGES.items():
            parameters: MemoryParameters = replace(PARAMETERS, **changes)  # type: ignore[arg-type]
            prototypes[tracker, name] = with_memory(base, parameters)
    found: dict[tuple[str, str], dict[str, float]] = {key: {} for key in prototypes}
    for data in SETS:
        for unshaken in sequences_of(data):
            clip = clip_of(unshaken, STRENGTH, 0, chosen.frames)
            for key, prototype in prototypes.items():
                auc, _, _ = one_pass(prototype.clone(), clip)
                found[key][f"{data} {unshaken.name}"] = auc
                print(*key, data, unshaken.name, auc, file=sys.stderr, flush=True)
    print(head(("tracker", "memory", "success", "difference")))
    for (tracker, name), values in found.items():
        gain = paired_difference(values, found[tracker, NONE])
        difference = f"{gain.value:+.4f} [{gain.low:+.4f}, {gain.high:+.4f}]"
        print(line((tracker, name, f"{np.mean(list(values.values())):.4f}", difference)))


if __name__ == "__main__":
    main()
