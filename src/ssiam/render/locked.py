"""`locked_views`: the target held at its position, by a camera that moves smoothly.

The path of the virtual camera is computed for the whole clip at once: first the smoothed path of
the target, then the size of the view, then its center.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, Transform, xywh_floats
from ssiam.motion import Motion
from ssiam.render.banded import BandedLeastSquares, Floats
from ssiam.render.leveled import leveled_path, smoothness
from ssiam.render.limits import Limit, StepLimit, solve_within
from ssiam.render.locked_config import LockedConfig
from ssiam.render.target_path import UNKNOWN, TargetPath, gaps, smooth_path, target_path

_LEVEL_SECONDS: Final = 4.0  # roll and zoom of the recording camera that last longer are kept
LEAST_WIDE: Final = 0.5  # of the largest view: at least this wide is the view of a lost target
_ANTICIPATION: Final = 1.0  # s before the target is found again, when the camera starts to move

EDGE_ZOOM: Final = 2.0  # times the largest magnification, for a target at the edge of the frame

_BORDER: Final = 0.008  # of the output's pixels
_MOST: Final = 0.98  # of the frames, whose shake leaves room for the view of a lost target

# Chosen on the ten test sequences with white shake of 3 %, by benchmarks/render/locked.py.
# Periods, s: faster movements are suppressed
_WIDE_PERIOD: Final = 3.0  # of the view without a target
_ZOOM_PERIOD: Final = 4.0  # of the size of the view
_RECOVERY: Final = 0.5  # of the center, after the frame's edge has held it back

# Weights; that of the target's position is 1 or more
_FOLLOW: Final = 0.1  # of the weight of the path, which is smooth already; at least 1
_HOLD: Final = 0.1  # last position of a lost target
_SIZE: Final = 0.1  # wanted size of the view
_TOO_LARGE: Final = 1e3  # a view that does not fit into the frame around the target
# The part of the view that is outside of the frame, times the weight of the target: the first one
# with which no more than _BORDER of the clip is outside. Chosen on shaken videos of DAVIS
_OUTSIDE: Final = (0.25, 1.0, 4.0, 16.0, 64.0, 256.0)
_OUTSIDE_LOST: Final = 4.0  # at least, while the target is lost: nothing is gained by a border
_TOO_FAST: Final = 1e9  # speed and acceleration above their limits


@dataclass(frozen=True, eq=False)
class LockedViews:
    """Views of all frames of a clip.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    out_from_raw : (N, 3, 3) float64
        Maps raw-frame pixels to output pixels: similarities.
    size_wh : (int, int)
        Width and height of the output, pixels; even.
    """

    out_from_raw: Transform
    size_wh: tuple[int, int]


def locked_views(
    motions: Sequence[Motion],
    boxes: Sequence[XYWH | None],
    config: LockedConfig | None = None,
    rate: float = 30.0,
) -> LockedViews:
    """Views of all frames of a clip, from what was recorded while tracking the target.

    Parameters
    ----------
    motions : sequence of Motion
        Camera motion to each frame; that of the first frame is not used.
    boxes : sequence of (x, y, w, h) or None
        The target in each frame, raw-frame pixels; None where it is lost or there is none.
    config : LockedConfig, optional
    rate : float
        Frames per second.

    Raises
    ------
    ArgumentError
        There is no frame, the numbers of motions and boxes differ, the rate is not positive, the
        frames' sizes differ, or a box is empty or not finite.
    """
    if not motions or len(motions) != len(boxes):
        raise ArgumentError(
            f"{len(motions)} motions and {len(boxes)} boxes: give one of each for every frame"
        )
    check_rate(rate)
    for motion, box in zip(motions, boxes, strict=True):
        check_recorded(motion, box, motions[0].size_wh)
    config = LockedConfig() if config is None else config
    clip = _Clip(motions, boxes, config, rate)
    target = clip.target()
    width = clip.view_width(target)
    size_wh = config.size_wh(clip.size_wh)
    out_from_scene = views_from_scene(clip.view_center(target, width), width, size_wh)
    return LockedViews(np.asarray(out_from_scene @ clip.scene_from_raw), size_wh)


def check_rate(rate: float) -> None:
    """Refuse a number of frames per second that is not positive and finite."""
    if not 0 < rate < float("inf"):
        raise ArgumentError(f"rate is {rate}: give frames per second, more than 0")


def check_recorded(motion: Motion, box: XYWH | None, size_wh: tuple[int, int]) -> None:
    """Refuse a motion of frames of another size, and a box that is empty or not finite."""
    if motion.size_wh != size_wh:
        width, height = size_wh
        raise ArgumentError(
            f"motion has size_wh {motion.size_wh}: "
            f"give the motion of frames of {width}x{height} pixels"
        )
    if box is None:
        return
    _, _, w, h = values = xywh_floats(box)
    if not np.isfinite(values).all() or w <= 0 or h <= 0:
        raise ArgumentError(f"box is {values}: give finite numbers, width and height more than 0")


def views_from_scene(center_xy: Floats, width: Floats, size_wh: tuple[int, int]) -> Transform:
    """Transforms (N, 3, 3) to the output, of views with center (N, 2) and width (N,)."""
    scale = size_wh[0] / width
    out_from_scene = np.zeros((len(width), 3, 3))
    out_from_scene[:, 0, 0] = out_from_scene[:, 1, 1] = scale
    out_from_scene[:, :2, 2] = (np.array(size_wh) - 1) / 2 - scale[:, None] * center_xy
    out_from_scene[:, 2, 2] = 1
    return out_from_scene


class _Clip:
    """What is known of a clip, in scene coordinates."""

    def __init__(
        self,
        motions: Sequence[Motion],
        boxes: Sequence[XYWH | None],
        config: LockedConfig,
        rate: float,
    ) -> None:
        self.config, self.rate = config, rate
        self.size_wh = motions[0].size_wh
        self.aspect = config.ratio(self.size_wh)
        self.full_width = config.full_width(self.size_wh)
        path = leveled_path(motions, _LEVEL_SECONDS * rate)
        self.scene_from_raw = path.scene_from_raw()
        self.raw_from_scene = np.asarray(np.linalg.inv(self.scene_from_raw), np.float64)
        # Half of the rotated view's width and height (N, 2) in the raw frame, for a width of 1
        cos, sin, tall = np.abs(np.cos(path.roll)), np.abs(np.sin(path.roll)), 1 / self.aspect
        half = np.stack([cos + sin * tall, sin + cos * tall], axis=1) / 2
        self.extent = half * np.exp(path.log_zoom)[:, None]
        # Where the camera looks without a target, and how large its view is
        even = np.ones(len(boxes))
        self.wide_xy = smooth_path(path.origin_xy, even, _WIDE_PERIOD * rate).solve()
        shake = np.quantile(np.abs(path.origin_xy - self.wide_xy), _MOST, axis=0)
        self.still_wh = np.maximum(np.array(self.size_wh) - 2 * shake, 0)
        self.wide_width = max(
            min(self.still_wh[0], self.still_wh[1] * self.aspect), LEAST_WIDE * self.full_width
        )
        self.seen = np.array([box is not None for box in boxes])
        self.boxes = _filled(boxes, (0.0, 0.0, *self.size_wh))

    def target(self) -> TargetPath:
        """The path of the target; that of the view without a target if there is none."""
        if not self.seen.any():
            return TargetPath(self.wide_xy, np.full(len(self.seen), UNKNOWN))
        measured_xy = _mapped(self.scene_from_raw, self.boxes[:, :2] + self.boxes[:, 2:] / 2)
        size = np.sqrt(np.maximum(self.boxes[:, 2] * self.boxes[:, 3], 1))
        return target_path(measured_xy, self.seen, size, self.config.tolerance, self.rate)

    def view_width(self, target: TargetPath) -> Floats:
        """Width (N,) of the view, scene pixels."""
        needed = np.maximum(self.boxes[:, 2], self.boxes[:, 3] * self.aspect)
        magnified = self.config.least_width(self.size_wh)
        contains = np.minimum(self.config.least_share * needed, self.wide_width)
        least = np.maximum(contains, magnified / EDGE_ZOOM)
        wanted = np.maximum(needed / self.config.target_share, np.maximum(contains, magnified))
        wanted = np.minimum(wanted, self.full_width)
        wanted[~self.seen] = self.wide_width
        fitting = np.maximum(self._fitting_width(target.xy), least)
        fitting = np.minimum(np.where(self.seen, fitting, self.wide_width), self.full_width)
        if self.config.zoom == "fixed":
            known = self.seen if self.seen.any() else ~self.seen
            width = min(np.median(wanted[known]), np.quantile(fitting[known], 0.1))
            width = max(width, np.quantile(least[known], 0.9))
            return np.full(len(known), min(float(width), self.full_width))
        base = BandedLeastSquares(len(wanted), 1)
        base.add_difference(0, _SIZE, np.log(np.minimum(wanted, fitting))[:, None])
        base.add_difference(3, smoothness(_ZOOM_PERIOD * self.rate, 3))
        ones, unlimited = np.ones(len(wanted)), np.full(len(wanted), -np.inf)
        limit = Limit(ones[:, None], unlimited, np.log(fitting), _TOO_LARGE * ones)
        slow = StepLimit(1, math.log(self.config.max_zoom_speed) / self.rate, _TOO_FAST)
        return np.minimum(np.exp(solve_within(base, [limit, slow])[:, 0]), self.full_width)

    def _fitting_width(self, target_xy: Floats) -> Floats:
        """Largest width (N,) of a view in the frame that has the target at its position."""
        raw_xy = _mapped(self.raw_from_scene, target_xy) + 0.5
        tall = 1 / self.aspect
        # Sides of the view from the target, for a width of 1; roll widens them
        wider = self.extent - (0.5, 0.5 * tall)
        before = np.array(self.config.position_xy) * (1, tall) + wider
        after = np.subtract(1, self.config.position_xy) * (1, tall) + wider
        low, high = raw_xy / before, (np.array(self.size_wh) - raw_xy) / after
        return np.asarray(np.minimum(low, high).min(axis=1))

    def view_center(self, target: TargetPath, width: Floats) -> Floats:
        """Center (N, 2) of the view, scene pixels."""
        view_wh = np.stack([width, width / self.aspect], axis=1)
        wanted = target.xy + (0.5 - np.array(self.config.position_xy)) * view_wh
        room = np.maximum(self.still_wh - view_wh, 0) / 2
        reached = np.clip(wanted, self.wide_xy - room, self.wide_xy + room)
        wanted = np.where(self.seen[:, None], wanted, reached)
        weight = np.where(self.seen, np.maximum(_FOLLOW * target.weight, 1), _HOLD)
        for start, stop in gaps(self.seen):
            if start > 0 and stop < len(weight):
                weight[max(start, stop - round(_ANTICIPATION * self.rate)) : stop] = UNKNOWN
        base = smooth_path(wanted, weight, _RECOVERY * self.rate)
        for outside in _OUTSIDE:
            penalty = np.where(self.seen, outside, max(outside, _OUTSIDE_LOST))
            inside = self._inside(width, penalty * np.maximum(weight, 1))
            center_xy = solve_within(base, [*inside, *self._steps()])
            violations = [np.abs(limit.bound(center_xy)[0]) for limit in inside]
            covered = 1 - np.stack(violations, axis=1) / (2 * self.extent * width[:, None])
            if 1 - covered.prod(axis=1).mean() <= _BORDER:
                break
        return center_xy

    def _inside(self, width: Floats, weight: Floats) -> list[Limit]:
        """The limits of the center of a view that is inside of the frame."""
        limits = []
        for axis, side in enumerate(self.size_wh):
            to_axis = self.raw_from_scene[:, axis]
            middle = (side - 1) / 2 - to_axis[:, 2]
            room = np.maximum(side / 2 - self.extent[:, axis] * width, 0)
            limits.append(Limit(to_axis[:, :2], middle - room, middle + room, weight))
        return limits

    def _steps(self) -> list[StepLimit]:
        """The limits of speed and acceleration."""
        speed = self.config.max_speed * self.size_wh[0] / self.rate
        acceleration = self.config.max_acceleration * self.size_wh[0] / self.rate**2
        return [StepLimit(1, speed, _TOO_FAST), StepLimit(2, acceleration, _TOO_FAST)]


def _mapped(matrices: Transform, points: Floats) -> Floats:
    """Map one point (N, 2) by each affine transform (N, 3, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", matrices[:, :2, :2], points) + matrices[:, :2, 2])


def _filled(boxes: Sequence[XYWH | None], default: XYWH) -> Floats:
    """Boxes (N, 4), with the last known, else the first known, else the default one in gaps."""
    filled: list[XYWH] = []
    last = next((box for box in boxes if box is not None), default)
    for box in boxes:
        last = last if box is None else box
        filled.append(last)
    return np.array(filled, dtype=np.float64)
