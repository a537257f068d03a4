"""Success of FEAR-XS on the sequences of a folder, one pass.

    python benchmarks/accuracy/fear_xs.py [--data FOLDER] [--stabilize off,predict]

Needs the folder of test data (see benchmarks/common/data.py). Other benchmarks load the tracker
under the name "fear_xs".
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

from ssiam.evaluation.measures.regions import upright
from ssiam.evaluation.measures.success import success

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import SEQUENCES, sequences
from benchmarks.common.loading import load


def main() -> None:
    """Print the success of every sequence, and the mean."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=SEQUENCES, help="folder of the sequences")
    parser.add_argument("--stabilize", default="off", help="methods, comma-separated")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    for method in arguments.stabilize.split(","):
        found = {}
        for name, sequence in sequences(arguments.data).items():
            tracker, images = load("fear_xs", method), sequence.images()
            tracker.init(next(images), sequence.box(0))
            boxes = [sequence.box(0), *(tracker.update(image).box for image in images)]
            found[name] = success(boxes, upright(sequence.truth)).auc
        cells = ", ".join(f"{name} {auc:.2f}" for name, auc in found.items())
        print(f"{method}: {np.mean(list(found.values())):.3f} ({cells})", flush=True)


if __name__ == "__main__":
    main()
