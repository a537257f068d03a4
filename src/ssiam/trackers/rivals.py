"""`Rivals`: what lies beside the target and looks like it.

A runner among runners looks less like the template than the next one does in a single frame, and
a tracker that takes the best of each frame goes with that one. Which is which is told by their
places: other peaks of the score are followed from frame to frame, and one that has been weaker
than the target for long is not it now, as long as something is seen where the target was and the
target has been well seen of late.
(KeepTrack, Mayer et al., ICCV 2021, learns to associate such candidates; here the place alone
does.)
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.trackers.siamese import Floats, TargetState

Flags = NDArray[np.bool_]

_SEEN: Final = 0.1  # score from which a peak is something
_MOST: Final = 6  # peaks
_STEP: Final = 0.5  # target sizes that a rival may move from frame to frame
_ONE: Final = 0.4  # target sizes within which candidates are of one thing
_MEMORY: Final = 0.8  # weight of the past in running scores
_KNOWN: Final = 3  # frames after which a rival is one
_CLEAR: Final = 0.35  # the target's running score from which its place is known
_WEAKER: Final = 0.75  # of the target's running score: at most a rival's
_GONE: Final = 0.03  # running score below which one is forgotten


class _Rival(NamedTuple):
    xy: Floats
    score: float  # running mean
    frames: int  # in which it was seen


class Rivals:
    """The rivals of one target, by their places in the view.

    Where the view is a predicted one the target stays in its place, and so does what moves with
    it or, under a shaking camera, with the scene.
    """

    def __init__(self) -> None:
        self._known: list[_Rival] = []
        self._own = 0.0  # the target's running score

    def taken(self, places: Floats, score: Floats, last: TargetState) -> Flags:
        """Candidates (n,) that show a rival; `follow` has to come next.

        None where the target itself is not seen, or has hardly been seen of late: one of them may
        be it.

        Parameters
        ----------
        places : (n, 2)
            Centres of the candidates' boxes, view pixels, row by row of a square map.
        score : (n,)
            0..1.
        last : TargetState
            Where the target was, or is expected, view pixels.
        """
        self._places, self._score = places, score
        self._size = math.sqrt(math.prod(last.size_wh))
        self._peaks = self._strongest()
        taken = np.zeros(len(score), dtype=np.bool_)
        own_off = self._off(places, np.asarray(last.center_xy))
        if self._own < _CLEAR or not (own_off[self._peaks] < _ONE).any():
            return taken
        for rival in self._known:
            if rival.frames >= _KNOWN and rival.score < _WEAKER * self._own:
                taken |= self._showing(rival, own_off)
        return taken

    def follow(self, best: int) -> None:
        """Candidate `best` is the target; what else looks like it is or becomes a rival."""
        seen = float(self._score[best])
        self._own = _mixed(self._own, seen) if self._own else seen
        own_xy = self._places[best]
        before, now = self._known, []
        for peak in self._peaks:
            xy, score = self._places[peak], float(self._score[peak])
            if self._off(xy, own_xy) < _ONE:
                continue
            same = min(before, key=lambda rival: self._off(rival.xy, xy), default=None)
            if same is None or self._off(same.xy, xy) > _STEP:
                now.append(_Rival(xy, score, 1))
            else:
                before = [rival for rival in before if rival is not same]
                now.append(_Rival(xy, _mixed(same.score, score), same.frames + 1))
        hidden = (rival._replace(score=_mixed(rival.score, 0.0)) for rival in before)
        self._known = now + [
            rival for rival in hidden if rival.score > _GONE and self._off(rival.xy, own_xy) > _ONE
        ]

    def _showing(self, rival: _Rival, own_off: Floats) -> Flags:
        """Candidates (n,) of the peak next to a rival's place; none if that is the target's.

        `own_off` (n,) is how far each is from the target, in its sizes.
        """
        moved = self._off(self._places[self._peaks], rival.xy)
        nearest = int(np.argmin(moved))
        peak = self._peaks[nearest]
        if moved[nearest] > min(_STEP, own_off[peak]):
            return np.zeros(len(self._score), dtype=np.bool_)
        off = self._off(self._places, self._places[peak])
        return np.asarray((off < _ONE) & (off < own_off))

    def _strongest(self) -> list[int]:
        """Peaks of the score, the strongest of each thing, from the strongest."""
        side = math.isqrt(len(self._score))
        maps = self._score.reshape(side, side)
        highest = cv2.dilate(maps, np.ones((3, 3), dtype=np.uint8)).ravel()
        tops = np.flatnonzero((self._score >= highest) & (self._score > _SEEN))
        found: list[int] = []
        for top in tops[np.argsort(-self._score[tops])].tolist():
            if (self._off(self._places[found], self._places[top]) > _ONE).all():
                found.append(top)
        return found[:_MOST]

    def _off(self, places: Floats, xy: Floats) -> Floats:
        """Distances (n,) of places (n, 2) from one, in target sizes."""
        return np.asarray(np.linalg.norm(places - xy, axis=-1) / self._size)


def _mixed(past: float, now: float) -> float:
    return _MEMORY * past + (1 - _MEMORY) * now
