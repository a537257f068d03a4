"""`blend`: one track from keyframes and from tracker runs between them, forward and backward.

A tracker measures where a target is in each frame, but its boxes differ from those of a person: by
an offset, by their size, and by drift. The keyframes say by how much. The difference at a keyframe
is a sample of a random process over time (a Gaussian process: a constant, a slow part and a part
of a few frames), and its expected value is added to the boxes between the keyframes. So an unusual
box in one frame changes its neighbors, and not everything up to the next keyframe.

Where neither run has followed the target from one keyframe to the other, straight lines between the
keyframes are better than either, and so they are where the score is low.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, iou

Floats: TypeAlias = NDArray[np.float64]
Bools: TypeAlias = NDArray[np.bool_]

# IoU of a run's last box with the keyframe there, above which the run has followed the target.
_ARRIVED: Final = 0.3
# IoU of two runs that have not arrived, above which they cross: both are on the target there.
_CROSSED: Final = 0.8
# Share of the largest IoU of two runs from which they count as crossing.
_NEAR_BEST: Final = 0.9
# Scores at which boxes are those of straight lines between the keyframes, and those of the runs.
_STRAIGHT_SCORE, _TRACKED_SCORE = 0.2, 0.6
# Frames over which one run fades into the other where both have lost the target.
_FADE: Final = 4
# Standard deviations of the differences: centers in widths and heights of the box, sizes as
# logarithms. Times in frames. Chosen by benchmarks/accuracy/annotator.py on videos of DAVIS.
_CONSTANT: Final = 0.05
_SLOW, _SLOW_FRAMES = 0.1, 25.0
_FAST, _FAST_FRAMES = 0.08, 2.0
_NOISE: Final = 0.01


@dataclass(frozen=True)
class Keyframe:
    """What a person says about one target in one frame.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    frame : int
        From 0.
    xywh : (x, y, w, h) floats, or None
        Upright box, pixels of the raw frame; None if the target is not visible from this frame to
        the next keyframe.
    """

    frame: int
    xywh: XYWH | None


@dataclass(frozen=True, eq=False)
class Run:
    """The boxes of a tracker that was started on a keyframe.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    boxes : (N, 4) float64
        x, y, w, h in the order in which the run has met the frames. The first is that of the
        keyframe's own frame as the *tracker* sees it (`SETTLING_UPDATES`), not the given box.
    scores : (N,) float64
    lost : (N,) bool
    """

    boxes: Floats
    scores: Floats
    lost: Bools


SETTLING_UPDATES: Final = 3
"""Updates on the keyframe's own image after which a tracker's box is its own there."""


@dataclass(frozen=True)
class Section:
    """Frames in which a target is visible, with the keyframes in them.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    first, last : int
        Frames, both included.
    keyframes : tuple of Keyframe
        At least one, all with a box, in the order of the frames.
    """

    first: int
    last: int
    keyframes: tuple[Keyframe, ...]

    def forward_ends(self) -> dict[int, int]:
        """The last frame of the forward run from each keyframe, by the keyframe's frame."""
        frames = [each.frame for each in self.keyframes]
        return dict(zip(frames, (*frames[1:], self.last), strict=True))

    def backward_ends(self) -> dict[int, int]:
        """The last (earliest) frame of the backward run from each keyframe."""
        frames = [each.frame for each in self.keyframes]
        return dict(zip(frames, (self.first, *frames[:-1]), strict=True))


def sections(keyframes: Sequence[Keyframe], first: int, last: int) -> list[Section]:
    """The sections of a clip in which a target is visible.

    Before its first keyframe the target is visible, unless that keyframe says that it is not.

    Parameters
    ----------
    keyframes : sequence of Keyframe
        Of one target, in any order, at most one for a frame.
    first, last : int
        First and last frame of the clip; keyframes outside are an error.

    Raises
    ------
    ArgumentError
        A keyframe is outside of the clip, or a frame has two.
    """
    ordered = sorted(keyframes, key=lambda each: each.frame)
    for before, after in pairwise(ordered):
        if before.frame == after.frame:
            raise ArgumentError(f"frame {after.frame} has two keyframes of one target: remove one")
    for each in ordered:
        if not first <= each.frame <= last:
            raise ArgumentError(
                f"the keyframe in frame {each.frame} is outside of the frames {first} to {last}: "
                "remove it, or track all frames"
            )
    found: list[Section] = []
    begin, current = first, list[Keyframe]()
    for each in ordered:
        if each.xywh is not None:
            current.append(each)
            continue
        if current:
            found.append(Section(begin, each.frame - 1, tuple(current)))
        current = []
        begin = next((k.frame for k in ordered if k.frame > each.frame and k.xywh), last + 1)
    if current:
        found.append(Section(begin, last, tuple(current)))
    return found


@dataclass(frozen=True, eq=False)
class Blend:
    """The track of one section; arrays have an element for each frame of it.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    boxes : (N, 4) float64
        x, y, w, h; those of the keyframes exactly.
    scores : (N,) float64
        0..1; 1 on keyframes.
    lost : (N,) bool
    agreement : (N,) float64
        IoU of forward and backward run, 0..1; nan where there is one run.
    backward_share : (N,) float64
        Weight of the backward run, 0..1.
    straight_share : (N,) float64
        Weight of straight lines between the keyframes, 0..1.
    """

    boxes: Floats
    scores: Floats
    lost: Bools
    agreement: Floats
    backward_share: Floats
    straight_share: Floats


def blend(section: Section, forward: Mapping[int, Run], backward: Mapping[int, Run]) -> Blend:
    """The track of a section.

    Parameters
    ----------
    section : Section
    forward, backward : mapping of int to Run
        Runs by the frames of the keyframes on which they were started, up to the frames of
        `Section.forward_ends` and `Section.backward_ends`. Where a run has no frame to go to, it
        may be missing.

    Returns
    -------
    Blend
    """
    size = section.last - section.first + 1
    track = _Raw.empty(size)
    differences: dict[int, list[Floats]] = {each.frame: [] for each in section.keyframes}
    given = {
        each.frame: _centered(np.array(each.xywh, dtype=np.float64)) for each in section.keyframes
    }
    frames = list(given)

    def fill(start: int, part: _Raw) -> None:
        offset = start - section.first
        track.put(offset, part)

    if frames[0] > section.first:
        run = _in_frame_order(backward[frames[0]])
        fill(section.first, _Raw.of(run, share=1.0))
        differences[frames[0]].append(_difference(given[frames[0]], _centered(run.boxes[-1])))
    for start, end in pairwise(frames):
        part = _between(forward[start], _in_frame_order(backward[end]), given[start], given[end])
        fill(start, part)
        differences[start].append(_difference(given[start], part.boxes[0]))
        differences[end].append(_difference(given[end], part.boxes[-1]))
    if frames[-1] < section.last:
        run = forward[frames[-1]]
        fill(frames[-1], _Raw.of(run, share=0.0))
        differences[frames[-1]].append(_difference(given[frames[-1]], _centered(run.boxes[0])))
    means = np.array([np.mean(each or [np.zeros(4)], axis=0) for each in differences.values()])
    boxes = _corrected(section, track.boxes, means)
    straight = np.zeros(size)
    between = slice(frames[0] - section.first, frames[-1] - section.first + 1)
    straight[between] = track.straight[between]
    share = straight[:, None]
    boxes = with_keyframes(section, (1 - share) * boxes + share * _straight(section))
    indexes = np.array(frames) - section.first
    track.scores[indexes], track.lost[indexes] = 1.0, False
    return Blend(boxes, track.scores, track.lost, track.agreement, track.share, straight)


def corrected(section: Section, boxes: Floats) -> Floats:
    """Boxes with their expected differences from those of a person.

    Parameters
    ----------
    section : Section
    boxes : (N, 4) float64
        x, y, w, h in each frame of the section, measured in the same way in all.

    Returns
    -------
    (N, 4) float64
        x, y, w, h.
    """
    tracked = _centered(boxes)
    differences = [
        _difference(_centered(np.array(each.xywh)), tracked[each.frame - section.first])
        for each in section.keyframes
    ]
    return _corrected(section, tracked, np.array(differences))


def with_keyframes(section: Section, boxes: Floats) -> Floats:
    """The boxes x, y, w, h (N, 4), exactly those of the keyframes in their frames."""
    kept = boxes.copy()
    for each in section.keyframes:
        kept[each.frame - section.first] = each.xywh
    return kept


def _corrected(section: Section, tracked: Floats, differences: Floats) -> Floats:
    """Boxes x, y, w, h of centered ones (N, 4) and their differences at the K keyframes (K, 4)."""
    indexes = np.array([each.frame for each in section.keyframes]) - section.first
    # Sizes of a person and of a tracker may differ by any constant factor; centers hardly do.
    base = np.array([0.0, 0.0, *differences[:, 2:].mean(axis=0)])
    expected = base + _expected(indexes, differences - base, np.arange(len(tracked)))
    boxes = tracked.copy()
    boxes[:, 2:] += expected[:, 2:]
    boxes[:, :2] += expected[:, :2] * np.exp(boxes[:, 2:])
    return with_keyframes(section, _upright(boxes))


def _straight(section: Section) -> Floats:
    """Straight lines between the keyframes (N, 4), constant before the first and after the last."""
    frames = np.arange(section.first, section.last + 1)
    known = [each.frame for each in section.keyframes]
    given = np.array([each.xywh for each in section.keyframes])
    return np.stack([np.interp(frames, known, side) for side in given.T], axis=1)


@dataclass(eq=False)
class _Raw:
    """Boxes before the differences are added: center x, center y, log width, log height."""

    boxes: Floats
    scores: Floats
    lost: Bools
    agreement: Floats
    share: Floats
    straight: Floats

    @classmethod
    def empty(cls, size: int) -> _Raw:
        boxes, lost = np.zeros((size, 4)), np.zeros(size, dtype=np.bool_)
        scores, share, straight = np.zeros((3, size))
        return cls(boxes, scores, lost, np.full(size, np.nan), share, straight)

    @classmethod
    def of(cls, run: Run, share: float) -> _Raw:
        """One run alone, in the order of the frames."""
        size = len(run.boxes)
        unknown, shares = np.full(size, np.nan), np.full(size, share)
        return cls(_centered(run.boxes), run.scores, run.lost, unknown, shares, np.zeros(size))

    def put(self, offset: int, part: _Raw) -> None:
        for name in ("boxes", "scores", "lost", "agreement", "share", "straight"):
            getattr(self, name)[offset : offset + len(part.boxes)] = getattr(part, name)


def _between(ahead: Run, back: Run, start: Floats, end: Floats) -> _Raw:
    """The frames between two keyframes from both runs, in the order of the frames."""
    size = len(ahead.boxes)
    agreement = iou(ahead.boxes, back.boxes)
    ahead_arrived = iou(ahead.boxes[-1], _upright(end)) > _ARRIVED
    back_arrived = iou(back.boxes[0], _upright(start)) > _ARRIVED
    position = np.arange(size, dtype=np.float64)
    is_followed = True
    if ahead_arrived and back_arrived:
        share = position / (size - 1)
    elif ahead_arrived or back_arrived:
        share = np.full(size, 0.0 if ahead_arrived else 1.0)
    elif agreement.max() > _CROSSED:
        crossing = np.median(np.flatnonzero(agreement >= _NEAR_BEST * agreement.max()))
        share = np.clip((position - crossing) / _FADE + 0.5, 0, 1)
    else:
        share, is_followed = (position > (size - 1) // 2).astype(np.float64), False
    weight = share[:, None]
    boxes = (1 - weight) * _centered(ahead.boxes) + weight * _centered(back.boxes)
    scores = (1 - share) * ahead.scores + share * back.scores
    lost = np.where(share < 0.5, ahead.lost, back.lost)
    straight = np.clip((_TRACKED_SCORE - scores) / (_TRACKED_SCORE - _STRAIGHT_SCORE), 0, 1)
    if not is_followed:
        straight[:] = 1.0
    return _Raw(boxes, scores, lost, agreement, share, straight)


def _in_frame_order(run: Run) -> Run:
    """A backward run in the order of the frames."""
    return Run(run.boxes[::-1], run.scores[::-1], run.lost[::-1])


def _centered(xywh: Floats) -> Floats:
    """Boxes (..., 4) as center x, center y, log width, log height."""
    wh = np.maximum(xywh[..., 2:], 1e-3)
    return np.concatenate([xywh[..., :2] + xywh[..., 2:] / 2, np.log(wh)], axis=-1)


def _upright(centered: Floats) -> Floats:
    """The inverse of `_centered`."""
    wh = np.exp(centered[..., 2:])
    return np.concatenate([centered[..., :2] - wh / 2, wh], axis=-1)


def _difference(given: Floats, tracked: Floats) -> Floats:
    """Center in widths and heights of the given box, sizes as logarithms."""
    return np.concatenate([(given[:2] - tracked[:2]) / np.exp(given[2:]), given[2:] - tracked[2:]])


def _expected(known_at: NDArray[np.int_], known: Floats, at: NDArray[np.int_]) -> Floats:
    """Expected differences (M, C) at times `at`, given those (N, C) at `known_at`."""
    among = _covariance(known_at, known_at) + _NOISE**2 * np.eye(len(known_at))
    return np.asarray(_covariance(at, known_at) @ np.linalg.solve(among, known))


def _covariance(at: NDArray[np.int_], other: NDArray[np.int_]) -> Floats:
    apart = np.abs(at[:, None] - other).astype(np.float64)
    slow = _SLOW**2 * np.exp(-0.5 * (apart / _SLOW_FRAMES) ** 2)
    return np.asarray(_CONSTANT**2 + slow + _FAST**2 * np.exp(-apart / _FAST_FRAMES))
