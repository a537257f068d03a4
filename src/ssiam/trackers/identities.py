"""Which target is which: joint decisions about the candidates of targets close to each other.

Each tracker of a group takes the best candidate of its own view. If two objects of a kind cross,
that may be the same object for both targets, or the other one's. The candidates of targets close to
each other are therefore assigned jointly: a candidate counts by its score and by its distance from
the position that the target's path predicts, no object is assigned twice, and a target may be
hidden by another one. Then it is assumed to move on as before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, iou, map_points
from ssiam.motion import Motion
from ssiam.trackers.followers import Decision, FrameResponse

Floats = NDArray[np.float64]

_HISTORY: Final = 15  # frames of a path by which its speed is known
_MIN_HISTORY: Final = 4  # boxes from which a speed is known
_SPEED_DECAY: Final = 0.97  # of the speed, per frame without a clear box
_UNCLEAR_GAIN: Final = 0.2  # share by which a path follows a box that is not clear
_SIZE_GAIN: Final = 0.1  # share by which a path's size follows a clear box
_MAX_SIDE_RATIO: Final = 1.3  # of a side to the last clear one
_MAX_SIZE_RATIO: Final = 2.0  # of two targets that can be confused
_FAR: Final = 3.0  # sums of two targets' sizes, distance from which they share no candidate
_NEAR: Final = 2.0  # target sizes, distance of targets whose candidates are assigned jointly
_SAME_OBJECT: Final = 0.5  # IoU from which two candidates are one object

# Of the utility of a candidate.
_MAX_LOGIT: Final = 4.0  # to which the logit of a score is clipped
_LOGIT_WEIGHT: Final = 1.0
_DEVIATION: Final = 0.25  # target sizes, of positions from their prediction
_DEVIATION_GROWTH: Final = 0.04  # target sizes per frame without the target
_MAX_DISTANCE_COST: Final = 8.0
_HIDDEN: Final = -3.0  # utility of a target hidden by another one
_NOT_COVERED: Final = -8.0  # the same if no other target is at its predicted position
_CONTACT: Final = 1.2  # distance of two targets that may touch, in their mean sides
_COVERED: Final = 0.2  # IoU of the predicted box with another target's from which it is covered
_MAX_JOINT: Final = 4  # targets whose candidates are assigned by trying all assignments


class TargetPath:
    """The path of a target in the scene, and its prediction at constant speed.

    Parameters
    ----------
    xywh : (x, y, w, h)
        Raw-frame pixels.
    others : sequence of TargetPath
        Of earlier targets, in the same frame. Those in the same box track the same object, because
        the caller gave it twice, and are never decided jointly with this one.
    """

    def __init__(self, xywh: XYWH, others: Sequence[TargetPath] = ()) -> None:
        self._twins = [each for each in others if iou(each.predicted, xywh) > _SAME_OBJECT]
        self._size_wh = np.array(xywh[2:])  # follows the boxes slowly
        self._center = _center(xywh)  # estimate for the current frame
        self._speed = np.zeros(2)  # in the scene, px per frame
        self._centers: list[Floats] = [self._center]  # the last clear ones, in the current frame
        self._ages = [0]  # frames since each of them
        self.frames_unclear = 0

    @property
    def size(self) -> float:
        """Geometric mean of the target's sides, pixels."""
        return math.sqrt(float(self._size_wh.prod()))

    @property
    def predicted(self) -> XYWH:
        """The target's box in the current frame at constant speed; raw-frame pixels."""
        (x, y), (w, h) = self._center.tolist(), self._size_wh.tolist()
        return x - w / 2, y - h / 2, w, h

    def is_twin_of(self, other: TargetPath) -> bool:
        """Whether the two targets were given as one object."""
        return any(each is other for each in self._twins) or any(
            each is self for each in other._twins
        )

    def advance(self, motion: Motion | None) -> None:
        """Move on to the next frame, reached by `motion`."""
        self.frames_unclear += 1
        self._ages = [age + 1 for age in self._ages]
        if motion is not None and motion.reliable:
            points = [*self._centers, self._center]
            *self._centers, self._center = map_points(motion.cur_from_prev, points)
        elif motion is not None:
            self._centers, self._ages = [], []
        self._center = self._center + self._speed
        self._speed = self._speed * _SPEED_DECAY

    def observe(self, xywh: XYWH) -> None:
        """Take `xywh` as the target's box in the current frame."""
        recent = [i for i, age in enumerate(self._ages) if age < _HISTORY]
        self._center = _center(xywh)
        self._size_wh = self._size_wh + _SIZE_GAIN * (np.array(xywh[2:]) - self._size_wh)
        self._centers = [*(self._centers[i] for i in recent), self._center]
        self._ages = [*(self._ages[i] for i in recent), 0]
        self.frames_unclear = 0
        if len(self._ages) >= _MIN_HISTORY:
            ages = np.array(self._ages, np.float64)
            time = ages.mean() - ages
            self._speed = np.asarray(time @ np.array(self._centers) / (time @ time))

    def rest_at(self, xywh: XYWH) -> None:
        """Assume that the lost target stays in `xywh`."""
        self._center, self._speed = _center(xywh), np.zeros(2)
        self._centers, self._ages = [], []

    def observe_unclear(self, xywh: XYWH) -> None:
        """Move toward `xywh`, a box that may be partly on another target."""
        if self.fits(xywh):
            self._center = self._center + _UNCLEAR_GAIN * (_center(xywh) - self._center)

    def fits(self, xywh: XYWH) -> bool:
        """Whether the target can have the size of a box: not that of parts or of two objects."""
        return all(
            1 / _MAX_SIDE_RATIO < now / last < _MAX_SIDE_RATIO
            for now, last in zip(xywh[2:], self._size_wh.tolist(), strict=True)
        )


@dataclass(frozen=True)
class _Option:
    index: int  # of the candidate; -1 for a hidden target
    xywh: XYWH  # raw-frame pixels
    utility: float


def decisions(
    paths: Sequence[TargetPath], responses: Sequence[FrameResponse | None]
) -> list[Decision | None]:
    """Decisions for the targets that are close to each other; None for the others.

    Parameters
    ----------
    paths : sequence of TargetPath
        In the current frame.
    responses : sequence of FrameResponse or None
        None for targets about which nothing can be decided.
    """
    predicted = [path.predicted for path in paths]
    result: list[Decision | None] = [None] * len(paths)
    for group in _close_targets(paths, predicted, responses):
        options = [_options(paths[i], predicted[i], responses[i]) for i in group]
        chosen = _assigned(options)
        clear = _are_clear(options, chosen)
        for i, option, is_clear in zip(group, chosen, clear, strict=True):
            response = responses[i]
            assert response is not None
            touched = any(_touch(predicted[i], predicted[j]) for j in group if j != i)
            is_clear &= not touched or paths[i].fits(option.xywh)
            result[i] = Decision(response, option.index, is_clear, predicted[i])
    return result


def _are_clear(options: Sequence[list[_Option]], chosen: Sequence[_Option]) -> list[bool]:
    """Whether each target has a candidate that no other target prefers or has taken."""
    favorites = [each[0] for each in options]
    return [
        option.index >= 0
        and not any(
            _is_same(option, other)
            for i, other in enumerate(favorites)
            if favorites[i] is not favorites[target]
        )
        for target, option in enumerate(chosen)
    ]


def _close_targets(
    paths: Sequence[TargetPath],
    predicted: Sequence[XYWH],
    responses: Sequence[FrameResponse | None],
) -> list[list[int]]:
    """Groups of indices of targets with a response that are close to each other."""
    best = {
        i: found.xywh(found.response.best) for i, found in enumerate(responses) if found is not None
    }
    group_of = {i: [i] for i in best}
    for i, j in combinations(best, 2):
        if group_of[i] is group_of[j]:
            continue
        sizes = paths[i].size, paths[j].size
        (x, y, w, h), (u, v, p, q) = predicted[i], predicted[j]
        distance = math.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2)
        if max(sizes) > _MAX_SIZE_RATIO * min(sizes) or distance > _FAR * sum(sizes):
            continue
        if distance < _NEAR * sum(sizes) / 2 or float(iou(best[i], best[j])) > _SAME_OBJECT:
            if paths[i].is_twin_of(paths[j]):
                continue
            merged = group_of[i] + group_of[j]
            for k in merged:
                group_of[k] = merged
    groups = {id(group): group for group in group_of.values()}
    return [sorted(group) for group in groups.values() if len(group) > 1]


def _options(path: TargetPath, predicted: XYWH, found: FrameResponse | None) -> list[_Option]:
    """The candidates of a target by descending utility, hidden the last one."""
    assert found is not None
    deviation = _DEVIATION + _DEVIATION_GROWTH * (path.frames_unclear - 1)
    options = []
    for index in found.response.objects:
        xywh = found.xywh(index)
        score = float(np.clip(found.response.score[index], 1e-9, 1 - 1e-9))
        logit = float(np.clip(math.log(score / (1 - score)), -_MAX_LOGIT, _MAX_LOGIT))
        distance = float(np.linalg.norm(_center(xywh) - _center(predicted))) / path.size
        cost = min((distance / deviation) ** 2 / 2, _MAX_DISTANCE_COST)
        options.append(_Option(index, xywh, _LOGIT_WEIGHT * logit - cost))
    options.sort(key=lambda option: -option.utility)
    return [*options, _Option(-1, predicted, _HIDDEN)]


def _assigned(options: Sequence[list[_Option]]) -> list[_Option]:
    """The options, one for each target, of the highest sum of utilities without a conflict."""
    if len(options) > _MAX_JOINT:
        return _greedy(options)
    best, best_utility = [each[-1] for each in options], -math.inf
    for chosen in _combinations(options, []):
        utility = sum(_utility(option, chosen) for option in chosen)
        if utility > best_utility:
            best, best_utility = chosen, utility
    return best


def _combinations(
    options: Sequence[list[_Option]], chosen: list[_Option]
) -> Iterator[list[_Option]]:
    """All choices of one option for each target in which no object is chosen twice."""
    if len(chosen) == len(options):
        yield chosen
        return
    for option in options[len(chosen)]:
        if not any(_is_same(option, other) for other in chosen):
            yield from _combinations(options, [*chosen, option])


def _greedy(options: Sequence[list[_Option]]) -> list[_Option]:
    """The option of the highest utility is chosen first."""
    chosen: dict[int, _Option] = {}
    pairs = [(option, target) for target, each in enumerate(options) for option in each]
    for option, target in sorted(pairs, key=lambda pair: -pair[0].utility):
        if target not in chosen and not any(_is_same(option, each) for each in chosen.values()):
            chosen[target] = option
    return [chosen[target] for target in range(len(options))]


def _is_same(option: _Option, other: _Option) -> bool:
    """Whether two options are one visible object."""
    return min(option.index, other.index) >= 0 and float(iou(option.xywh, other.xywh)) > (
        _SAME_OBJECT
    )


def _utility(option: _Option, chosen: Sequence[_Option]) -> float:
    """The utility of an option; lower for a hidden target that nothing covers."""
    if option.index >= 0:
        return option.utility
    visible = [each.xywh for each in chosen if each.index >= 0]
    covered = any(float(iou(option.xywh, each)) > _COVERED for each in visible)
    return _HIDDEN if covered else _NOT_COVERED


def _touch(xywh: XYWH, other: XYWH) -> bool:
    """Whether two predicted targets are so close that they may touch."""
    reach = _CONTACT * (np.array(xywh[2:]) + other[2:]) / 2
    return bool((np.abs(_center(xywh) - _center(other)) < reach).all())


def _center(xywh: XYWH) -> Floats:
    x, y, w, h = xywh
    return np.array([x + w / 2, y + h / 2])
