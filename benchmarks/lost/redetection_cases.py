"""What a tracker did while its target was gone and after."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from benchmarks.lost.splice import Floats, Splice
from ssiam.geometry import iou

TRACKED = 0.5  # IoU
BEFORE = 5  # last frames before the target goes, whose median tells if it is tracked
TELL = 10  # frames to tell that it is gone
STAYS, OF = 10, 15  # frames in which it has to be held after it is found
NEVER = float("inf")


@dataclass(frozen=True)
class Case:
    """What a tracker did on one clip; frames that never came are infinite.

    `told_after` and `found_after` count from the first frame in which the target is gone and
    there again. `absent` are the frames in which `lost` should be told, `claims` those of them in
    which it is not, `longest` the longest run of these and `longest_elsewhere` of those whose box
    is not where the hidden target is. `seen` are the frames in which the target is seen and
    tracked, `false_lost` those of them that tell `lost`.
    """

    setting: str
    name: str
    kind: str
    tracked: bool
    told_after: float
    found_after: float
    absent: int
    claims: int
    longest: int
    longest_elsewhere: int
    seen: int
    false_lost: int


def judge(setting: str, clip: Splice, boxes: Floats, lost: NDArray[np.bool_]) -> Case:
    """The figures of one run, of the boxes (N, 4) and `lost` (N,) of all frames."""
    first, end = clip.gone
    overlap = iou(boxes, clip.truth)
    overlap[0] = np.nan  # given
    held = ~lost & (overlap > TRACKED)
    claimed = ~lost[first + TELL : end]
    elsewhere = ~(iou(boxes, clip.place)[first + TELL : end] > TRACKED)
    before = overlap[:first][~np.isnan(overlap[:first])]
    return Case(
        setting,
        clip.name,
        clip.kind,
        tracked=bool(np.median(before[-BEFORE:]) > TRACKED),
        told_after=next(iter(np.flatnonzero(lost[first:end])), NEVER),
        found_after=_frames_to_find(held[end:]),
        absent=len(claimed),
        claims=int(claimed.sum()),
        longest=_longest_run(claimed),
        longest_elsewhere=_longest_run(claimed & elsewhere),
        seen=int((overlap > TRACKED).sum()),
        false_lost=int((lost & (overlap > TRACKED)).sum()),
    )


def _frames_to_find(held: NDArray[np.bool_]) -> float:
    """The first frame that holds the target and is followed by enough that do too."""
    for index in np.flatnonzero(held):
        if held[index + 1 : index + 1 + OF].sum() >= STAYS:
            return float(index)
    return NEVER


def _longest_run(flags: NDArray[np.bool_]) -> int:
    """How many flags in a row are set at most."""
    return max((len(list(run)) for flag, run in groupby(flags.tolist()) if flag), default=0)
