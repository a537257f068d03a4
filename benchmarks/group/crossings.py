"""How often the identities of two targets are kept when they cross.

    python benchmarks/group/crossings.py [--trackers lite] [--set report] [--real N] [--drawn N]
        [--verbose]

Two targets of one `TrackerGroup` are tracked through the clips of
benchmarks/group/crossing_clips.py, with and without the group's knowledge of each other. The set
"report" has the crossings of TUD-Campus, PETS09-S3-MF1 and urban-intersection (at present, all in
TUD-Campus), which no network was trained on, and drawn clips up to 40 in all; it only reports. The
set "choose" has those of ADL-Rundle-6, and other drawn clips; parameters are chosen on it.

The outcome is decided by the last five frames in which both targets are annotated. Kept: the median
IoU with the own object is at least .3, and more than with the other. Swapped: with the other, the
same. Otherwise the target is off. A clip is kept if both targets are. Two on one: frames in which
the IoU of the two boxes exceeds .5 more than that of the objects does, and neither is reported
lost. Needs the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import shlex
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import cv2
import numpy as np

from ssiam import TrackerGroup
from ssiam.geometry import iou
from ssiam.trackers import StabilizedTracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import MOT
from benchmarks.common.loading import load
from benchmarks.common.tables import head, line
from benchmarks.group.crossing_clips import CrossingClip, Floats, drawn_clip, real_clips

REPORTED = ("TUD-Campus", "PETS09-S3-MF1", "urban-intersection")
CHOOSING = ("ADL-Rundle-6",)
CLIPS = 40  # in each set
DRAWN_SEED = {"report": 1000, "choose": 0}  # of the first drawn clip
LAST = 5  # frames that decide the outcome
KEPT = 0.3  # IoU
DOUBLE = 0.5  # IoU by which two boxes on one object overlap more than the objects

HEAD = ("tracker", "group", "clips", "kept", "targets kept", "swapped", "off", "two on one", "lost")


@dataclass(frozen=True)
class Outcome:
    """Outcome of one clip.

    Attributes
    ----------
    name : str
    kept, swapped : tuple of bool
        Of both targets.
    frames, doubles, lost : int
        Frames, those with two boxes on one object, and reports of a lost target.
    """

    name: str
    kept: tuple[bool, bool]
    swapped: tuple[bool, bool]
    frames: int
    doubles: int
    lost: int


def clips_of(
    name: str, most_real: int | None = None, most_drawn: int | None = None
) -> list[CrossingClip]:
    """The clips of a set; of each kind all, or the first ones."""
    real = [
        clip
        for each in (REPORTED if name == "report" else CHOOSING)
        for clip in real_clips(MOT / each)
    ]
    first = DRAWN_SEED[name]
    seeds = range(first, first + max(CLIPS - len(real), 16))
    return real[:most_real] + [drawn_clip(seed) for seed in seeds[:most_drawn]]


def outcome(prototype: StabilizedTracker, clip: CrossingClip, aware: bool) -> Outcome:
    """Track both targets of a clip."""
    group = TrackerGroup(prototype, aware=aware)
    frames = clip.frames()
    group.init(next(frames), clip.truth[:, 0].tolist())
    tracks = [group.update(frame) for frame in frames]
    boxes = np.array([[track.box for track in each] for each in tracks]).transpose(1, 0, 2)
    lost = np.array([[track.lost for track in each] for each in tracks]).T
    truth = clip.truth[:, 1:]
    known = np.flatnonzero(np.isfinite(truth).all(axis=(0, 2)))
    last = known[-LAST:]
    own = [float(np.median(iou(boxes[each], truth[each])[last])) for each in (0, 1)]
    other = [float(np.median(iou(boxes[each], truth[1 - each])[last])) for each in (0, 1)]
    return Outcome(
        clip.name,
        (own[0] >= KEPT and own[0] > other[0], own[1] >= KEPT and own[1] > other[1]),
        (other[0] >= KEPT and other[0] > own[0], other[1] >= KEPT and other[1] > own[1]),
        len(tracks),
        _doubles(boxes, truth, lost),
        int(lost.sum()),
    )


def _doubles(boxes: Floats, truth: Floats, lost: Floats) -> int:
    """Frames with two boxes on one object."""
    overlap = np.nan_to_num(iou(truth[0], truth[1]))
    return int(((iou(boxes[0], boxes[1]) > overlap + DOUBLE) & ~lost.any(axis=0)).sum())


def row(setting: str, aware: bool, own: list[Outcome]) -> str:
    """A line of the table."""
    kept = [flag for each in own for flag in each.kept]
    swapped = [flag for each in own for flag in each.swapped]
    frames = sum(each.frames for each in own)
    return line(
        (
            setting,
            "aware" if aware else "unaware",
            len(own),
            f"{100 * float(np.mean([all(each.kept) for each in own])):.1f} %",
            f"{100 * float(np.mean(kept)):.1f} %",
            sum(swapped),
            len(kept) - sum(kept) - sum(swapped),
            f"{100 * sum(each.doubles for each in own) / frames:.1f} %",
            f"{50 * sum(each.lost for each in own) / frames:.1f} %",
        )
    )


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trackers", nargs="+", default=("lite",))
    parser.add_argument("--stabilize", default="predict")
    parser.add_argument("--set", choices=("report", "choose"), default="report")
    parser.add_argument("--real", type=int, help="number of real clips; default: all")
    parser.add_argument("--drawn", type=int, help="number of drawn clips; default: all")
    parser.add_argument("--only", nargs="+", choices=("aware", "unaware"), help="default: both")
    parser.add_argument("--verbose", action="store_true", help="print a line for every clip")
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    chosen = parsed_arguments()
    cv2.setNumThreads(1)
    clips = clips_of(chosen.set, chosen.real, chosen.drawn)
    print(f"    python benchmarks/group/crossings.py {shlex.join(sys.argv[1:])}\n")
    rows = []
    for name, aware in product(chosen.trackers, (False, True)):
        if ("aware" if aware else "unaware") not in (chosen.only or ("aware", "unaware")):
            continue
        tracker = load(name, chosen.stabilize)
        outcomes = [outcome(tracker, clip, aware) for clip in clips]
        for each in outcomes if chosen.verbose else ():
            print(name, "aware" if aware else "unaware", each, flush=True)
        for kind in ("real", "drawn"):
            own = [each for each in outcomes if each.name.startswith("drawn") == (kind == "drawn")]
            rows.append(row(f"{name}, {kind}", aware, own))
        rows.append(row(f"{name}, all", aware, outcomes))
    print(head(HEAD), *rows, sep="\n")


if __name__ == "__main__":
    main()
