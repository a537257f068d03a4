"""How often one click gives the right box (`ssiam track` without --box).

    python benchmarks/accuracy/click.py [--data FOLDER ...] [--frame 0] [--off-center 0]

For a click at the center of the true box, the IoU of the proposed box with it; and the share of
sequences in which that is more than one half. --off-center moves the click: 0.25 is half way from
the center to an edge, the mean of the four directions is reported. The constants of
`ssiam.web.picking.proposals` were chosen on frames 20, 45 and 70 of the ten sequences, whose first
frames are reported. A second rule was also run on both sets of first frames and dropped, so neither
figure is entirely independent of the choice. The example clip is reported by itself. Needs the
folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from ssiam.geometry import XYWH, Image, iou
from ssiam.video import open_source
from ssiam.web.picking.proposals import BoxProposer

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import EXAMPLES, RESERVE, SEQUENCES, sequences

RIGHT = 0.5  # IoU from which a proposal counts as right


def clicked(proposer: BoxProposer, image: Image, truth: XYWH, off_center: float) -> list[float]:
    """IoU of the proposals for clicks at this distance from the center, in shares of the sides."""
    x, y, w, h = truth
    steps = [(1, 0), (-1, 0), (0, 1), (0, -1)] if off_center else [(0, 0)]
    return [
        float(iou(proposer.propose(image, (x + w * (0.5 + dx), y + h * (0.5 + dy))), truth))
        for dx, dy in off_center * np.array(steps)
    ]


def main() -> None:
    """Print one line a sequence, and one a folder."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, nargs="+", default=[SEQUENCES, RESERVE])
    parser.add_argument("--frame", type=int, default=0)
    parser.add_argument("--off-center", type=float, default=0.0)
    chosen = parser.parse_args()
    proposer = BoxProposer()
    with open_source(EXAMPLES / "shaky-walker.mp4") as frames:
        image = next(frames).image
    walker = np.loadtxt(EXAMPLES / "shaky-walker.txt", delimiter=",")[0]
    found = clicked(proposer, image, tuple(walker.tolist()), chosen.off_center)
    print(f"the example clip, frame 0: IoU {np.mean(found):.2f}")
    for folder in chosen.data:
        overlaps, began = [], time.perf_counter()
        for sequence in sequences(folder).values():
            image = next(sequence.images(chosen.frame))
            found = clicked(proposer, image, sequence.box(chosen.frame), chosen.off_center)
            print(f"{sequence.name:>24}: IoU {np.mean(found):.2f}")
            overlaps += found
        seconds = (time.perf_counter() - began) / len(overlaps)
        right = np.mean(np.array(overlaps) > RIGHT)
        print(
            f"{folder.name}: IoU > {RIGHT} in {100 * right:.0f} % of {len(overlaps)} clicks, "
            f"mean {np.mean(overlaps):.2f}, {seconds:.2f} s a click"
        )


if __name__ == "__main__":
    main()
