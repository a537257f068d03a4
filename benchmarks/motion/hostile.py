"""Frames that break estimators of camera motion: no exception, nothing but plausible motions.

    python benchmarks/motion/hostile.py [--frames 100000] [--seed 0]

Streams of 200 frames change between lakes, gravel, stripes, one color, noise, cuts, zooms, mirrored
and torn frames, flicker and single pixels (`tests/helpers/hostile_frames.py`), some with a few
pixels only. The boxes to exclude are broken in half of the frames: nan, infinite, negative, of the
whole frame. `CameraMotion` with each model must be plausible (`Motion.is_plausible`), and the
identity where it is not reliable, and so must what the adapters give to other trackers.

Prints the share of reliable motions by kind, and the seed and frame of every fault; the exit code
is 1 if there is one.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from itertools import count
from pathlib import Path

import cv2

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
from benchmarks.common.tables import head, line
from helpers.hostile_frames import checked_stream

LENGTH = 200  # frames of a stream


def main() -> int:
    """Run the streams, with the progress on standard error."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0, help="of the first stream")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    frames, reliable, faults = Counter[str](), Counter[str](), 0
    for seed in count(options.seed):
        left = options.frames - frames.total()
        if left <= 0:
            break
        for index, (kind, is_reliable, fault) in enumerate(checked_stream(seed, min(LENGTH, left))):
            frames[kind] += 1
            reliable[kind] += is_reliable
            if fault:
                faults += 1
                print(f"stream {seed}, frame {index}, {kind}: {fault}", flush=True)
        print(f"{frames.total()} frames, {faults} faults", end="\r", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print(head(["frames", "number", "reliable"]))
    for kind, number in sorted(frames.items()):
        print(line([kind, number, f"{100 * reliable[kind] / number:.0f} %"]))
    print(f"{frames.total()} frames, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
