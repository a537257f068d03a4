"""Keyframes that a simulated annotator needs for a whole clip, against straight interpolation.

    python benchmarks/accuracy/annotator.py [--data FOLDER] [--tracker lite] [--frames 150]
        [--iou 0.8] [--share 0.95] [--order worst|doubt]

The annotator gives the true box in the first frame. Then he corrects one frame after the other with
its true box, until the IoU is at least --iou in --share of the frames with a target. The next frame
is the one with the lowest IoU, as one would see it, for both methods; with --order doubt it is, for
the tracker, the first of "look here" (the worst one if there is none).

Interpolation is what annotation tools do: x, y, w and h are straight lines between keyframes, and
constant before the first and after the last. The tracker is that of `ssiam track --corrections`:
runs from each keyframe to the next and to the one before it, blended, with the edges of the masks
in the blended boxes; --no-masks leaves these out. A mask is computed again where the IoU of its box
with the next round's is below .95.

The numbers of the blend and of the masks (`blending.py` and `mask_edges.py` in
`src/ssiam/exchange`) were chosen on ten held-out videos of DAVIS, those of the masks also on tracks
of SNMOT-116 and ADL-Rundle-6; --data gives their folder. The default, the reserve, chooses nothing.
Needs the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.datasets import VideoSequence
from ssiam.exchange import (
    Blend,
    Keyframe,
    Run,
    Section,
    blend,
    doubtful_frames,
    sections,
    with_mask_edges,
)
from ssiam.exchange.blending import SETTLING_UPDATES
from ssiam.geometry import Image, iou
from ssiam.stabilize import FrameView
from ssiam.trackers.box_mask import BoxMask

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import RESERVE, sequences
from benchmarks.common.loading import load
from benchmarks.common.tables import line

Boxes = NDArray[np.float64]
Method = Callable[[Sequence[int]], tuple[Boxes, Sequence[int]]]
SAME_CROP = 0.95  # IoU of boxes whose masks are the same
HEAD = "| sequence | frames | interpolation | tracked | IoU >= {:g} after the first box |"


class TrackedClip:
    """Runs of a tracker from any frame of a clip, each continued only as far as it is needed."""

    def __init__(
        self,
        tracker: ssiam.StabilizedTracker,
        sequence: VideoSequence,
        frames: int,
        *,
        has_masks: bool = True,
    ) -> None:
        self._tracker = tracker
        self._box_mask = tracker.view_tracker.box_mask if has_masks else None
        self._bounds: dict[int, tuple[Boxes, Boxes]] = {}
        self._images: list[Image] = list(sequence.images())[:frames]
        self.truth = _upright(np.asarray(sequence.truth[:frames], np.float64))
        self._running: dict[tuple[int, int], tuple[ssiam.StabilizedTracker, list[ssiam.Track]]] = {}

    def run(self, start: int, end: int, direction: int) -> Run:
        """The run from frame `start` to `end`; `direction` is 1 or -1."""
        if (start, direction) not in self._running:
            tracker = self._tracker.clone()
            tracker.init(self._images[start], self.truth[start].tolist())
            settled = [tracker.update(self._images[start]) for _ in range(SETTLING_UPDATES)]
            self._running[start, direction] = tracker, settled[-1:]
        tracker, tracks = self._running[start, direction]
        length = abs(end - start) + 1
        while len(tracks) < length:
            track = tracker.update(self._images[start + direction * len(tracks)])
            tracks.append(track.with_changes(mask=None, corners=None))
        used = tracks[:length]
        return Run(
            np.array([track.box for track in used], np.float64),
            np.array([track.score for track in used], np.float64),
            np.array([track.lost for track in used], np.bool_),
        )

    def blended(self, keyframes: Sequence[int]) -> tuple[Section, Blend]:
        """The track through the true boxes of some frames."""
        given = [Keyframe(frame, _xywh(self.truth[frame])) for frame in keyframes]
        (section,) = sections(given, 0, len(self.truth) - 1)
        ahead = {a: self.run(a, b, 1) for a, b in section.forward_ends().items()}
        back = {a: self.run(a, b, -1) for a, b in section.backward_ends().items()}
        track = blend(section, ahead, back)
        if self._box_mask is None:
            return section, track
        bounds = [
            self._mask_bounds(self._box_mask, index, box) for index, box in enumerate(track.boxes)
        ]
        return section, with_mask_edges(section, track, np.array(bounds))

    def _mask_bounds(self, box_mask: BoxMask, index: int, box: Boxes) -> Boxes:
        """Bounds of the mask in a box of a frame, or in one that is nearly the same."""
        if index not in self._bounds or iou(self._bounds[index][0], box) < SAME_CROP:
            view = FrameView(self._images[index], border=0)
            self._bounds[index] = box, box_mask.bounds(view, _xywh(box))
        return self._bounds[index][1]

    def tracked(self, keyframes: Sequence[int]) -> tuple[Boxes, Sequence[int]]:
        """The boxes of `blended`, and the frames of "look here"."""
        section, track = self.blended(keyframes)
        return track.boxes, [each.frame for each in doubtful_frames(section, track)]

    def interpolated(self, keyframes: Sequence[int]) -> tuple[Boxes, Sequence[int]]:
        """Straight lines between the true boxes of some frames."""
        known, frames = sorted(keyframes), np.arange(len(self.truth))
        sides = [np.interp(frames, known, self.truth[known, side]) for side in range(4)]
        return np.stack(sides, axis=1), ()


def _upright(truth: Boxes) -> Boxes:
    """Ground truth as upright boxes (N, 4): those around rotated ones."""
    if truth.shape[1] == 4:
        return truth
    corners = truth.reshape(len(truth), -1, 2)
    low, high = corners.min(axis=1), corners.max(axis=1)
    return np.concatenate([low, high - low], axis=1)


def _xywh(box: Boxes) -> tuple[float, float, float, float]:
    x, y, w, h = box.tolist()
    return x, y, w, h


@dataclass(frozen=True)
class Goal:
    """When an annotator is content: IoU of at least `iou` in `share` of the frames."""

    iou: float
    share: float


def keyframes_needed(
    truth: Boxes, method: Method, goal: Goal, *, by_doubt: bool
) -> tuple[int, float]:
    """Number of keyframes, and the share of good frames after the first one."""
    has_target = np.isfinite(truth).all(axis=1)
    keyframes = [int(np.flatnonzero(has_target)[0])]
    first_share = None
    while True:
        boxes, doubts = method(keyframes)
        overlap = np.nan_to_num(iou(boxes, truth))
        share = float((overlap[has_target] >= goal.iou).mean())
        first_share = share if first_share is None else first_share
        if share >= goal.share:
            return len(keyframes), first_share
        candidates = np.where(has_target, overlap, np.inf)
        candidates[keyframes] = np.inf
        proposed = [f for f in doubts if np.isfinite(candidates[f])] if by_doubt else []
        keyframes.append(proposed[0] if proposed else int(candidates.argmin()))


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=RESERVE, help="folder of the sequences")
    parser.add_argument("--tracker", default="lite")
    parser.add_argument("--frames", type=int, default=10**6, help="at most, of each sequence")
    parser.add_argument("--iou", type=float, default=0.8)
    parser.add_argument("--share", type=float, default=0.95)
    parser.add_argument("--order", choices=("worst", "doubt"), default="worst")
    parser.add_argument("--no-masks", action="store_true", help="boxes of the tracker alone")
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    chosen = parsed_arguments()
    cv2.setNumThreads(1)
    tracker = load(chosen.tracker, "predict")
    goal = Goal(chosen.iou, chosen.share)
    print(f"    python benchmarks/accuracy/annotator.py {shlex.join(sys.argv[1:])}\n")
    head = HEAD.format(chosen.iou)
    print(head)
    print("|---" * (head.count("|") - 1) + "|")
    totals = np.zeros(2, int)
    for sequence in sequences(chosen.data).values():
        clip = TrackedClip(tracker, sequence, chosen.frames, has_masks=not chosen.no_masks)
        straight, _ = keyframes_needed(clip.truth, clip.interpolated, goal, by_doubt=False)
        ours, first = keyframes_needed(
            clip.truth, clip.tracked, goal, by_doubt=chosen.order == "doubt"
        )
        totals += straight, ours
        cells = (sequence.name, str(len(clip.truth)), str(straight), str(ours), f"{first:.2f}")
        print(line(cells), flush=True)
    ratio = f"{totals[1] / totals[0]:.2f} of interpolation's"
    print(line(("all", "", str(totals[0]), str(totals[1]), ratio)))


if __name__ == "__main__":
    main()
