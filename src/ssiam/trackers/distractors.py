"""`DistractorTracker`: tracks objects that look like the target.

In a single frame a distractor may match the template better than the target does, and a tracker
that takes the best candidate of each frame switches to it. The positions distinguish the two:
other peaks of the score map are tracked from frame to frame, and a peak that has had a lower
score than the target for several frames is excluded, if there is a peak at the target's position
and the target's recent scores are high. (KeepTrack, Mayer et al.,
ICCV 2021, learns to associate such candidates; here only their positions are used.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.trackers.siamese import Floats, TargetState

Flags = NDArray[np.bool_]

_MIN_PEAK: Final = 0.1  # score above which a local maximum is a peak
_MAX_PEAKS: Final = 6  # number of peaks that are tracked
_MAX_STEP: Final = 0.5  # target sizes that a distractor may move from frame to frame
_SAME_OBJECT: Final = 0.4  # target sizes within which candidates belong to one object
_MEMORY: Final = 0.8  # weight of the past in running means of scores
_MIN_FRAMES: Final = 3  # frames after which a tracked peak counts as a distractor
_MIN_TARGET_SCORE: Final = 0.35  # mean score of the target from which its position is trusted
_MAX_RATIO: Final = 0.75  # of a distractor's mean score to the target's
_FORGET_BELOW: Final = 0.03  # mean score below which a distractor is dropped


class _Distractor(NamedTuple):
    xy: Floats
    score: float  # running mean
    frames: int  # in which it was seen


@dataclass(frozen=True, eq=False)
class ScoredCandidates:
    """The candidates of one frame, as `DistractorTracker.detect` returns them.

    Attributes
    ----------
    positions_xy : (n, 2) float64
        Centers, view pixels.
    score : (n,) float64
        0..1.
    target_size : float
        Geometric mean of the target's sides, view pixels.
    anchors : int
        Candidates in each cell of the map.
    is_distractor : (n,) bool
        Whether each candidate belongs to a distractor.
    """

    positions_xy: Floats
    score: Floats
    target_size: float
    anchors: int
    is_distractor: Flags

    @cached_property
    def peaks(self) -> list[int]:
        """Indices of the highest local maxima, one for each object, by descending score."""
        return _peaks(self.positions_xy, self.score, self.target_size, self.anchors)

    @property
    def allowed_score(self) -> Floats:
        """The scores (n,), -1 for candidates of a distractor."""
        return np.where(self.is_distractor, -1.0, self.score)

    def near(self, peak: int) -> Flags:
        """Whether each candidate (n,) belongs to the object of a peak."""
        return self.distances(self.positions_xy, self.positions_xy[peak]) < _SAME_OBJECT

    def groups(self) -> list[Flags]:
        """For each object, which of the candidates (n,) belong to it, by descending score."""
        return [self.near(peak) for peak in self.peaks]

    def distances(self, positions_xy: Floats, xy: Floats) -> Floats:
        """Distances (n,) of positions (n, 2) from a point (2,), in target sizes."""
        return np.asarray(np.linalg.norm(positions_xy - xy, axis=-1) / self.target_size)


class DistractorTracker:
    """Tracks the distractors of one target by their positions in the view.

    In a predicted view, objects that move like the target keep their positions; if only the camera
    shakes, so does the whole scene.

    Parameters
    ----------
    enabled : bool
        If not, there are never any distractors.
    """

    def __init__(self, enabled: bool = True) -> None:
        self._enabled = enabled
        self._distractors: list[_Distractor] = []
        self._target_score = 0.0  # running mean

    def detect(
        self, positions_xy: Floats, score: Floats, last: TargetState, anchors: int = 1
    ) -> ScoredCandidates:
        """Find the candidates that belong to a known distractor.

        There are none if no peak is at the target's position, or if the target's mean score is
        low: one of the other peaks may then be the target.

        Parameters
        ----------
        positions_xy : (n, 2) float64
            Centers of the candidates' boxes, view pixels, row by row of a square map for each
            anchor.
        score : (n,) float64
            0..1.
        last : TargetState
            Last or predicted state of the target, view pixels.
        anchors : int
            Candidates in each cell of the map.

        Returns
        -------
        ScoredCandidates
            To be passed to `update`.
        """
        size = math.sqrt(math.prod(last.size_wh))
        flags = np.zeros(len(score), dtype=np.bool_)
        candidates = ScoredCandidates(positions_xy, score, size, anchors, flags)
        if not self._enabled or self._target_score < _MIN_TARGET_SCORE or not candidates.peaks:
            return candidates
        from_target = candidates.distances(positions_xy, np.asarray(last.center_xy))
        if (from_target[candidates.peaks] < _SAME_OBJECT).any():
            max_score = _MAX_RATIO * self._target_score
            for distractor in self._distractors:
                if distractor.frames >= _MIN_FRAMES and distractor.score < max_score:
                    flags |= _candidates_of(distractor, candidates, from_target)
        return candidates

    def update(self, candidates: ScoredCandidates, best: int) -> None:
        """Take candidate `best` as the target, and the other peaks as distractors."""
        if not self._enabled:
            return
        best_score = float(candidates.score[best])
        self._target_score = (
            _running_mean(self._target_score, best_score) if self._target_score else best_score
        )
        target_xy = candidates.positions_xy[best]
        unmatched, matched = self._distractors, []
        for peak in candidates.peaks:
            xy, score = candidates.positions_xy[peak], float(candidates.score[peak])
            if candidates.distances(xy, target_xy) < _SAME_OBJECT:
                continue
            nearest = min(
                unmatched, key=lambda other: candidates.distances(other.xy, xy), default=None
            )
            if nearest is None or candidates.distances(nearest.xy, xy) > _MAX_STEP:
                matched.append(_Distractor(xy, score, 1))
            else:
                unmatched = [other for other in unmatched if other is not nearest]
                running = _running_mean(nearest.score, score)
                matched.append(_Distractor(xy, running, nearest.frames + 1))
        hidden = (other._replace(score=_running_mean(other.score, 0.0)) for other in unmatched)
        self._distractors = matched + [
            other
            for other in hidden
            if other.score > _FORGET_BELOW
            and candidates.distances(other.xy, target_xy) > _SAME_OBJECT
        ]


def _peaks(positions_xy: Floats, score: Floats, target_size: float, anchors: int) -> list[int]:
    """Indices of the score maps' peaks in descending order, one for each object."""
    side = math.isqrt(len(score) // anchors)
    score_map = score.reshape(anchors, side, side).max(axis=0)
    local_maximum = cv2.dilate(score_map, np.ones((3, 3), dtype=np.uint8)).ravel()
    maxima = np.flatnonzero((score >= np.tile(local_maximum, anchors)) & (score > _MIN_PEAK))
    peaks: list[int] = []
    for index in maxima[np.argsort(-score[maxima])].tolist():
        distances = np.linalg.norm(positions_xy[peaks] - positions_xy[index], axis=-1)
        if (distances / target_size > _SAME_OBJECT).all():
            peaks.append(index)
    return peaks[:_MAX_PEAKS]


def _candidates_of(
    distractor: _Distractor, candidates: ScoredCandidates, from_target: Floats
) -> Flags:
    """Candidates (n,) of the peak nearest to a distractor; none if that is the target's peak.

    `from_target` (n,) is each candidate's distance from the target, in target sizes.
    """
    positions_xy, peaks = candidates.positions_xy, candidates.peaks
    steps = candidates.distances(positions_xy[peaks], distractor.xy)
    nearest = int(np.argmin(steps))
    peak = peaks[nearest]
    if steps[nearest] > min(_MAX_STEP, from_target[peak]):
        return np.zeros(len(candidates.score), dtype=np.bool_)
    from_peak = candidates.distances(positions_xy, positions_xy[peak])
    return np.asarray((from_peak < _SAME_OBJECT) & (from_peak < from_target))


def _running_mean(past: float, now: float) -> float:
    return _MEMORY * past + (1 - _MEMORY) * now
