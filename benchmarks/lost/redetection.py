"""Detection of lost targets and re-detection: how often, and how many frames they take.

    python benchmarks/lost/redetection.py [--trackers nanotrack_v3,csrt] [--stabilize off,paper]
        [--data FOLDER] [--shake 0.03] [--jobs 2] [--verbose]

The clips of benchmarks/lost/clips.py: real sequences whose target is covered, out of the frame, or
cut away for 1-3 s. Every tracker is started once, on the first frame. The goals: `lost` is
reported within 10 frames in >= 90 % of the cases, and on <= 2 % of the frames in which the target
is tracked; the target is re-detected within 30 frames of its return in >= 70 % of the cases; and
nothing else is reported as the target while it is absent. Needs the folder of test data (see
benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import shlex
import sys
from dataclasses import dataclass
from itertools import chain, groupby, product
from pathlib import Path

import cv2
import joblib
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import iou
from ssiam.stabilize import METHODS
from ssiam.trackers import StabilizedTracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import SEQUENCES, sequences
from benchmarks.common.loading import load
from benchmarks.common.tables import head, line
from benchmarks.lost.clips import KINDS, AbsenceClip, Floats, absence_clips

TRACKED = 0.5  # IoU of a tracked target
BEFORE = 5  # last frames before the absence, whose median decides whether the target is tracked
DETECTION_LIMIT = 10  # frames until the loss should be reported
REDETECTION_LIMIT = 30  # frames until the target should be re-detected
MIN_TRACKED, WINDOW = 10, 15  # after re-detection it must be tracked in 10 of 15 frames
FALSE_CLAIM = 5  # consecutive frames in which something else is reported as the target
NEVER = float("inf")

HEAD = (
    "tracker",
    "absence",
    "cases",
    "lost before",
    "reported lost",
    "frames to report",
    "false lost",
    "re-detected",
    "frames to re-detect",
    "claimed while absent",
    f"cases with a claim of {FALSE_CLAIM} frames",
    "elsewhere",
)


@dataclass(frozen=True)
class Case:
    """Result of a tracker on one clip; numbers of frames are infinite if the event did not occur.

    Attributes
    ----------
    setting : str
        Tracker and stabilization method.
    name, kind : str
        Name and kind of the clip.
    tracked : bool
        Whether the target was tracked before the absence.
    reported_after, found_after : float
        Frames from the first one of the absence to the report of the loss, and from the first one
        after it to the re-detection.
    absent, claims : int
        Frames in which the loss should be reported, and those of them in which it is not.
    longest_claim, longest_elsewhere : int
        Longest run of claims, and of claims with a box that is not on the hidden target.
    visible, false_lost : int
        Frames in which the visible target is tracked, and those of them reported as lost.
    """

    setting: str
    name: str
    kind: str
    tracked: bool
    reported_after: float
    found_after: float
    absent: int
    claims: int
    longest_claim: int
    longest_elsewhere: int
    visible: int
    false_lost: int


def cases_of(name: str, stabilize: str, clips: list[AbsenceClip]) -> list[Case]:
    """Run one tracker on the clips."""
    cv2.setNumThreads(1)
    tracker = load(name, stabilize)
    setting = f"{name} {stabilize}"
    return [evaluate(setting, clip, *tracked(tracker.clone(), clip)) for clip in clips]


def tracked(tracker: StabilizedTracker, clip: AbsenceClip) -> tuple[Floats, NDArray[np.bool_]]:
    """Boxes (N, 4) and `lost` (N,) of all frames of a clip; the first box is the true one."""
    frames = clip.frames()
    tracker.init(next(frames), clip.truth[0].tolist())
    tracks = [tracker.update(frame) for frame in frames]
    boxes = np.array([clip.truth[0], *(track.box for track in tracks)])
    return boxes, np.array([False, *(track.lost for track in tracks)])


def evaluate(setting: str, clip: AbsenceClip, boxes: Floats, lost: NDArray[np.bool_]) -> Case:
    """Evaluate the boxes (N, 4) and `lost` (N,) of one run."""
    first, end = clip.absence
    overlap = iou(boxes, clip.truth)
    overlap[0] = np.nan  # the given box
    is_tracked = ~lost & (overlap > TRACKED)
    claimed = ~lost[first + DETECTION_LIMIT : end]
    elsewhere = ~(iou(boxes, clip.full_truth)[first + DETECTION_LIMIT : end] > TRACKED)
    before = overlap[:first][~np.isnan(overlap[:first])]
    return Case(
        setting,
        clip.name,
        clip.kind,
        tracked=bool(np.median(before[-BEFORE:]) > TRACKED),
        reported_after=float(next(iter(np.flatnonzero(lost[first:end])), NEVER)),
        found_after=_frames_to_redetect(is_tracked[end:]),
        absent=len(claimed),
        claims=int(claimed.sum()),
        longest_claim=_longest_run(claimed),
        longest_elsewhere=_longest_run(claimed & elsewhere),
        visible=int((overlap > TRACKED).sum()),
        false_lost=int((lost & (overlap > TRACKED)).sum()),
    )


def _frames_to_redetect(is_tracked: NDArray[np.bool_]) -> float:
    """Index of the first frame with the target tracked that is followed by enough such frames."""
    for index in np.flatnonzero(is_tracked):
        if is_tracked[index + 1 : index + 1 + WINDOW].sum() >= MIN_TRACKED:
            return float(index)
    return NEVER


def _longest_run(flags: NDArray[np.bool_]) -> int:
    """Length of the longest run of set flags."""
    return max((len(list(run)) for flag, run in groupby(flags.tolist()) if flag), default=0)


def row(setting: str, kind: str, own: list[Case]) -> str:
    """A line of the table."""
    cases = [case for case in own if case.tracked]
    cells: list[object] = [setting, kind, len(cases), len(own) - len(cases)]
    cells += [share([case.reported_after < DETECTION_LIMIT for case in cases])]
    cells += [median([case.reported_after for case in cases])]
    cells += [ratio(sum(case.false_lost for case in own), sum(case.visible for case in own))]
    cells += [share([case.found_after < REDETECTION_LIMIT for case in cases])]
    cells += [median([case.found_after for case in cases])]
    cells += [ratio(sum(case.claims for case in cases), sum(case.absent for case in cases))]
    cells += [share([case.longest_claim >= FALSE_CLAIM for case in cases])]
    cells += [share([case.longest_elsewhere >= FALSE_CLAIM for case in cases])]
    return line(cells)


def share(flags: list[bool]) -> str:
    """The share of set flags."""
    return ratio(sum(flags), len(flags))


def ratio(part: int, whole: int) -> str:
    """A ratio in percent."""
    return f"{100 * part / whole:.1f} %" if whole else "-"


def median(frames: list[float]) -> str:
    """The median number of frames, "never" if it is infinite."""
    middle = float(np.median(frames)) if frames else NEVER
    return f"{middle:g}" if np.isfinite(middle) else "never"


def verbose(case: Case) -> str:
    """A line about one case."""
    return (
        f"{case.setting}: {case.name}: tracked before {case.tracked}, reported after "
        f"{case.reported_after:g}, re-detected after {case.found_after:g}, claims {case.claims} of "
        f"{case.absent} (longest {case.longest_claim}, elsewhere {case.longest_elsewhere}), "
        f"false lost {case.false_lost} of {case.visible}"
    )


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trackers", default="nanotrack_v3", help="names, comma-separated")
    parser.add_argument("--stabilize", default=METHODS[-1], help="methods, comma-separated")
    parser.add_argument("--kinds", default=",".join(KINDS), help="of clips, comma-separated")
    parser.add_argument("--data", type=Path, default=SEQUENCES, help="folder of the sequences")
    parser.add_argument("--shake", type=float, default=0.0, help="sd, share of the width")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--verbose", action="store_true", help="print a line for every case")
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    arguments = parsed_arguments()
    clips, unsuitable = absence_clips(sequences(arguments.data), arguments.shake)
    settings = list(product(arguments.trackers.split(","), arguments.stabilize.split(",")))
    clips = [clip for clip in clips if clip.kind in arguments.kinds.split(",")]
    parts = [clips[job :: arguments.jobs] for job in range(arguments.jobs)]
    calls = [joblib.delayed(cases_of)(*each, part) for each, part in product(settings, parts)]
    cases: list[Case] = list(chain.from_iterable(joblib.Parallel(n_jobs=arguments.jobs)(calls)))
    if arguments.verbose:
        print(*(f"{name}: {reason}" for name, reason in unsuitable.items()), sep="\n")
        print(*map(verbose, cases), sep="\n")
    print(f"    python benchmarks/lost/redetection.py {shlex.join(sys.argv[1:])}\n")
    print(head(HEAD))
    for tracker, stabilize in settings:
        setting = f"{tracker} {stabilize}"
        own = [case for case in cases if case.setting == setting]
        for kind in dict.fromkeys(case.kind for case in own):
            print(row(setting, kind, [case for case in own if case.kind == kind]))
        print(row(setting, "all", own))


if __name__ == "__main__":
    main()
