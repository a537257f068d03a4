"""Mean IoU and success of the trackers, alone and stabilized, through the command line.

    python benchmarks/accuracy/sequences.py [--as-published]

Runs `ssiam track` on four real sequences and on a shaking clip, and prints the table of
docs/explanation/benchmarks.md. Needs the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures.success import success
from ssiam.geometry import iou

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import VIDEOS, nanotrack_weights, sequences

SEQUENCES = ("Couple", "Jumping", "bag_vot2015", "dtb70_MountainBike6")
TRACKERS = ("csrt", "kcf", "nanotrack_v2", "nanotrack_v3")
METHODS = ("off", "paper")
CLIP, CLIP_BOX = "shaky-5.avi", (290, 95, 175, 165)  # the red sculpture


def track(
    source: Path, box: tuple[float, ...], tracker: str, stabilize: str
) -> list[dict[str, str]]:
    """Rows of the CSV file that `ssiam track` writes."""
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "results.csv"
        command = [sys.executable, "-m", "ssiam", "track", str(source)]
        command += ["--box", ",".join(f"{v:.4f}" for v in box), "--tracker", tracker]
        command += ["--stabilize", stabilize, "--results", str(results)]
        if tracker.startswith("nanotrack"):
            command += ["--weights", str(nanotrack_weights(tracker))]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        with results.open() as file:
            return list(csv.DictReader(file))


def folder(sequence: VideoSequence) -> Path:
    """Folder of the sequence's images."""
    assert isinstance(sequence.frames, tuple)
    return sequence.frames[0].parent


def boxes(rows: list[dict[str, str]]) -> NDArray[np.float64]:
    """Boxes (N, 4) of the rows."""
    return np.array([[float(row[key]) for key in "xywh"] for row in rows])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--as-published", action="store_true", help="without conversion of 1-based boxes"
    )
    as_published = parser.parse_args().as_published
    real = sequences(as_published=as_published)
    head = [f"{t} {m}" for t in TRACKERS for m in METHODS]
    print("| sequence | " + " | ".join(head) + " |")
    print("|---" * (len(head) + 1) + "|")
    for name in SEQUENCES:
        sequence = real[name]
        truth = np.array([sequence.box(index) for index in range(len(sequence))])
        cells = []
        for tracker in TRACKERS:
            for stabilize in METHODS:
                found = boxes(track(folder(sequence), tuple(truth[0]), tracker, stabilize))
                overlaps = iou(found, truth)
                cells.append(f"{overlaps.mean():.3f} ({success(found, truth).auc:.3f})")
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    cells = []
    for tracker in TRACKERS:
        for stabilize in METHODS:
            rows = track(VIDEOS / CLIP, CLIP_BOX, tracker, stabilize)
            lost = sum(row["lost"] in ("1", "True", "true") for row in rows)
            cells.append(f"{len(rows)} frames, lost in {lost}")
    print(f"| {CLIP} (no ground truth) | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
