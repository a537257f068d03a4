"""Re-detection of targets that were away for 3 to 30 s.

    python benchmarks/lost/away.py [--trackers lite] [--data FOLDER] [--kinds pan cut] [--verbose]

The clips of benchmarks/lost/away_clips.py; every tracker is started once, on the first frame. The
goals: the target is re-detected within 60 frames of its return in >= 85 % of the cases; another
object is reported as tracked in <= 3 % of the frames in which the target is away, after the first
ten; `lost` is reported in <= 2 % of the frames in which the visible target is tracked. By default
on the sequences of the folder of test data that choose nothing (see benchmarks/common/data.py);
--data names others.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import iou

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import RESERVE, sequences
from benchmarks.common.loading import load
from benchmarks.common.tables import head, line
from benchmarks.lost.away_clips import KINDS, away_clips
from benchmarks.lost.clips import AbsenceClip, Floats
from benchmarks.lost.redetection import TRACKED, Case, evaluate, ratio, share, tracked, verbose

LIMIT = 60  # frames until the target should be re-detected
HEAD = (
    "tracker",
    "away",
    "cases",
    "lost before",
    "re-detected within 60 frames",
    "another as tracked, frames",
    "another as tracked, 5 frames in a row",
    "false lost",
)


@dataclass(frozen=True)
class Result:
    """Counts of one clip; see `benchmarks.lost.redetection.Case`."""

    kind: str
    tracked: bool
    found: bool
    absent: int
    elsewhere: int
    longest: int
    visible: int
    false_lost: int


def row(setting: str, kind: str, own: list[Result]) -> str:
    """A line of the table."""
    cases = [each for each in own if each.tracked]
    return line(
        (
            setting,
            kind,
            len(cases),
            len(own) - len(cases),
            share([each.found for each in cases]),
            ratio(sum(each.elsewhere for each in cases), sum(each.absent for each in cases)),
            share([each.longest >= 5 for each in cases]),
            ratio(sum(each.false_lost for each in own), sum(each.visible for each in own)),
        )
    )


def causes(
    clip: AbsenceClip,
    case: Case,
    boxes: Floats,
    lost: NDArray[np.bool_],
    is_other: NDArray[np.bool_],
) -> str:
    """Why a case fails, from the boxes (N, 4) and `lost` (N,) of a run.

    Another object is tracked because the tracker slid onto it without a loss, or because it was
    taken for the target in the search. A target that is not re-detected was refused (a box is on
    it, but reported as lost), or another object is tracked, or it was not found.
    """
    first, end = clip.absence
    since_loss = np.cumsum(lost[first:]) > 0
    slid = int((is_other & ~since_loss[10 : end - first]).sum())
    overlap = iou(boxes, clip.truth)
    false_lost = lost & (overlap > TRACKED)
    found = int(min(end + case.found_after, len(lost)))
    parts = [
        f"others {int(is_other.sum())}: slid {slid}, found {int(is_other.sum()) - slid}",
        f"false lost: before {int(false_lost[:end].sum())}, "
        f"until re-detected {int(false_lost[end:found].sum())}, "
        f"later {int(false_lost[found:].sum())}",
    ]
    if not case.found_after < LIMIT:
        seen, unseen = overlap[end : end + LIMIT], lost[end : end + LIMIT]
        refused, other = int((unseen & (seen > TRACKED)).sum()), int((~unseen).sum())
        parts.append(f"not re-detected: refused {refused}, others {other} of {len(seen)}")
    return "; ".join(parts)


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trackers", nargs="+", default=("lite",))
    parser.add_argument("--data", type=Path, default=RESERVE, help="folder of the sequences")
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    parser.add_argument(
        "--verbose", action="store_true", help="print a line for every case, and causes"
    )
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    chosen = parsed_arguments()
    cv2.setNumThreads(1)
    clips, unsuitable = away_clips(sequences(chosen.data), chosen.kinds)
    print(f"    python benchmarks/lost/away.py {shlex.join(sys.argv[1:])}\n")
    if chosen.verbose:
        print(*(f"{name}: {reason}" for name, reason in unsuitable.items()), sep="\n")
    rows = []
    for name in chosen.trackers:
        prototype = load(name)
        results = []
        for clip in clips:
            boxes, lost = tracked(prototype.clone(), clip)
            case = evaluate(name, clip, boxes, lost)
            first, end = clip.absence
            away = slice(first + 10, end)
            is_other = ~lost[away] & ~(iou(boxes[away], clip.full_truth[away]) > TRACKED)
            results.append(
                Result(
                    clip.kind,
                    case.tracked,
                    case.found_after < LIMIT,
                    case.absent,
                    int(is_other.sum()),
                    case.longest_elsewhere,
                    case.visible,
                    case.false_lost,
                )
            )
            if chosen.verbose:
                print(f"{verbose(case)}; {causes(clip, case, boxes, lost, is_other)}", flush=True)
        for kind in dict.fromkeys(each.kind for each in results):
            rows.append(row(name, kind, [each for each in results if each.kind == kind]))
        rows.append(row(name, "all", results))
    print(head(HEAD), *rows, sep="\n")


if __name__ == "__main__":
    main()
