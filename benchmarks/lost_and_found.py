"""How often a tracker tells that its target is gone, and finds it again.

    python benchmarks/lost_and_found.py [--trackers nanotrack_v3,csrt] [--stabilize off,paper]
        [--data FOLDER] [--shake 0.03] [--jobs 2] [--verbose]

The clips of benchmarks/splices.py: real sequences whose target is covered, out of the frame, or cut
away for 1-3 s. Every tracker is started once, on the first frame. The aim: `lost` is told within
10 frames in >= 90 % of the cases and on <= 2 % of the frames where the target is tracked; the
target is found again within 30 frames of its return in >= 70 %; and nothing else is taken for it
while it is away. Needs the folder of test data (see shared_data.py).
"""

from __future__ import annotations

import argparse
import shlex
import sys
from itertools import chain, product
from pathlib import Path

import cv2
import joblib
import numpy as np
from numpy.typing import NDArray

from loading import load
from lost_and_found_cases import NEVER, TELL, Case, judge
from shared_data import SEQUENCES, sequences
from splice import Floats, Splice
from splices import KINDS, splices
from ssiam.stabilize import METHODS
from ssiam.trackers.stabilized import StabilizedTracker

FIND = 30  # frames to find it again
CLAIM = 5  # frames for which something else is taken for it

HEAD = (
    "tracker",
    "gone",
    "cases",
    "lost before",
    "told lost",
    "frames to tell",
    "false lost",
    "found",
    "frames to find",
    "claimed while gone",
    f"cases with a claim of {CLAIM} frames",
    "elsewhere",
)


def runs(name: str, stabilize: str, clips: list[Splice]) -> list[Case]:
    """One tracker over some clips."""
    cv2.setNumThreads(1)
    tracker = load(name, stabilize)
    setting = f"{name} {stabilize}"
    return [judge(setting, clip, *followed(tracker.clone(), clip)) for clip in clips]


def followed(tracker: StabilizedTracker, clip: Splice) -> tuple[Floats, NDArray[np.bool_]]:
    """Boxes (N, 4) and `lost` (N,) of all frames of a clip; the first box is given."""
    frames = clip.frames()
    tracker.init(next(frames), clip.truth[0].tolist())
    tracks = [tracker.update(frame) for frame in frames]
    boxes = np.array([clip.truth[0], *(track.box for track in tracks)])
    return boxes, np.array([False, *(track.lost for track in tracks)])


def row(setting: str, kind: str, own: list[Case]) -> str:
    """A line of the table."""
    cases = [case for case in own if case.tracked]
    cells = [setting, kind, len(cases), len(own) - len(cases)]
    cells += [share([case.told_after < TELL for case in cases])]
    cells += [median([case.told_after for case in cases])]
    cells += [ratio(sum(case.false_lost for case in own), sum(case.seen for case in own))]
    cells += [share([case.found_after < FIND for case in cases])]
    cells += [median([case.found_after for case in cases])]
    cells += [ratio(sum(case.claims for case in cases), sum(case.absent for case in cases))]
    cells += [share([case.longest >= CLAIM for case in cases])]
    cells += [share([case.longest_elsewhere >= CLAIM for case in cases])]
    return "| " + " | ".join(map(str, cells)) + " |"


def share(flags: list[bool]) -> str:
    """How many of the flags are set."""
    return ratio(sum(flags), len(flags))


def ratio(part: int, whole: int) -> str:
    """A share in percent."""
    return f"{100 * part / whole:.1f} %" if whole else "-"


def median(frames: list[float]) -> str:
    """The median, where most of them ever came."""
    middle = float(np.median(frames)) if frames else NEVER
    return f"{middle:g}" if np.isfinite(middle) else "never"


def verbose(case: Case) -> str:
    """A line about one clip."""
    return (
        f"{case.setting}: {case.name}: tracked before {case.tracked}, told after "
        f"{case.told_after:g}, found after {case.found_after:g}, claims {case.claims} of "
        f"{case.absent} (longest {case.longest}, elsewhere {case.longest_elsewhere}), false lost "
        f"{case.false_lost} of {case.seen}"
    )


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trackers", default="nanotrack_v3", help="names, with commas")
    parser.add_argument("--stabilize", default=METHODS[-1], help="methods, with commas")
    parser.add_argument("--kinds", default=",".join(KINDS), help="of clips, with commas")
    parser.add_argument("--data", type=Path, default=SEQUENCES, help="folder of the sequences")
    parser.add_argument("--shake", type=float, default=0.0, help="sd, share of the width")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--verbose", action="store_true", help="a line for every case")
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    chosen = arguments()
    clips, unfit = splices(sequences(chosen.data), chosen.shake)
    settings = list(product(chosen.trackers.split(","), chosen.stabilize.split(",")))
    clips = [clip for clip in clips if clip.kind in chosen.kinds.split(",")]
    shares = [clips[part :: chosen.jobs] for part in range(chosen.jobs)]
    calls = [joblib.delayed(runs)(*each, share) for each, share in product(settings, shares)]
    cases: list[Case] = list(chain.from_iterable(joblib.Parallel(n_jobs=chosen.jobs)(calls)))
    if chosen.verbose:
        print(*(f"{name}: {why}" for name, why in unfit.items()), sep="\n")
        print(*map(verbose, cases), sep="\n")
    print(f"    python benchmarks/lost_and_found.py {shlex.join(sys.argv[1:])}\n")
    print("| " + " | ".join(HEAD) + " |")
    print("|---" * len(HEAD) + "|")
    for tracker, stabilize in settings:
        setting = f"{tracker} {stabilize}"
        own = [case for case in cases if case.setting == setting]
        for kind in dict.fromkeys(case.kind for case in own):
            print(row(setting, kind, [case for case in own if case.kind == kind]))
        print(row(setting, "all", own))


if __name__ == "__main__":
    main()
