"""`TargetPredictor`: views that show the target where the tracker last saw it.

A Siamese tracker searches for its target around the last position. Camera motion and the target's
own motion predict the next position: the view moves the frame so that the prediction appears where
the tracker will search. Four predictions compete, and "same position in the frame" is used unless
another one was clearly better in the last frames: without shake the view is the raw frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from ssiam.copying import DeepCopied
from ssiam.geometry import (
    IDENTITY,
    XYWH,
    Transform,
    inverse,
    map_point,
    rigid,
    rigid_parameters,
)
from ssiam.motion import Motion
from ssiam.stabilize.config import PredictConfig

Point = tuple[float, float]  # x, y in pixels

_MAX_ERROR: Final = 2.0  # target sizes; larger errors of a prediction are cut off
_LOW_SCORE: Final = 0.15  # a box with a lower score does not update the target's speed
_INITIAL_ERROR: Final = 0.3  # target sizes, of the predictions without camera motion
_UNTESTED_ERROR: Final = 0.3  # target sizes, of all predictions before the first frame
_LOW_SCORE_WEIGHT: Final = 0.5  # weight, in frames, of a low-score box
_SPEED_LOSS: Final = 0.1  # share of its speed that a target loses in each low-score frame
# In each frame the view returns toward the raw frame by a share of its shift and rotation. The step
# is limited to what trackers tolerate.
_RETURN: Final = 0.05  # share
_MAX_RETURN_STEP: Final = 0.1  # target sizes
_MAX_TURN: Final = 0.1  # radians: a target may be upright in a scene that turns
_MIN_OFFSET: Final = 0.01  # target sizes, and radians: below it the view is the raw frame


class Hypothesis(IntEnum):
    """Predictions of the target's next position."""

    STILL = 0  # same position in the frame
    MOVING = 1  # same velocity in the frame
    FIXED = 2  # same position in the scene
    MOVING_IN_SCENE = 3  # same velocity in the scene


_STANDING: Final = (0.0, 0.0), (0.0, 0.0)
_WITH_CAMERA: Final = (Hypothesis.FIXED, Hypothesis.MOVING_IN_SCENE)


@dataclass(frozen=True, eq=False)
class _Step:
    """A frame after `update` and before `observe` or `hold`."""

    motion: Motion
    positions: tuple[Point, ...]  # predicted centers by `Hypothesis`, raw-frame pixels
    prev_stab_from_raw: Transform


class TargetPredictor(DeepCopied):
    """Chooses ``stab_from_raw`` by the predicted target position, one frame at a time.

    For each frame call `update`, and then `observe` with the tracker's box, `move_to` after a
    re-detection, or `hold` if the frame is blank. Without an `update` before, `observe` only sets
    the box and `hold` changes nothing.

    Threads: one thread at a time for each object; several objects are independent.

    Parameters
    ----------
    config : PredictConfig
        `prefer` and `find` are not used here.
    xywh : (x, y, w, h)
        The target in the first frame, raw-frame pixels.

    Attributes
    ----------
    stab_from_raw : (3, 3) float64
        The view of the frame of the last `update`; raw-frame to stabilized pixels.
    """

    def __init__(self, config: PredictConfig, xywh: XYWH) -> None:
        self._config = config
        self.stab_from_raw: Transform = IDENTITY
        # Running means of the errors by hypothesis, target sizes. The predictions with camera
        # motion are preferred at first: a shake can lose the target in one frame, a pan that
        # follows the target cannot.
        self._errors = [_INITIAL_ERROR, _INITIAL_ERROR, 0.0, 0.0]
        self._missing_error = _UNTESTED_ERROR  # that the errors with camera motion lack
        self._speeds = _STANDING  # px per frame: in the frame, in the scene
        self._elapsed = 1  # frames since the last box
        self._step: _Step | None = None
        self._box = xywh
        self._center = _center(xywh)

    def move_to(self, xywh: XYWH) -> None:
        """Set the target's box (raw-frame pixels) and a speed of 0; the errors are kept."""
        self._set_box(xywh)
        self._speeds = _STANDING

    def coast(self, xywh: XYWH) -> None:
        """Set the assumed box (raw-frame pixels) of a hidden target; speed and errors are kept."""
        self._elapsed = 1
        self._set_box(xywh)

    def update(self, motion: Motion) -> XYWH:
        """Predict the box in the next frame, reached by `motion`; raw-frame pixels.

        Also sets `stab_from_raw` to the view of that frame.
        """
        cur_from_prev = motion.at(self._center)
        positions = self._predict(cur_from_prev)
        self._step = _Step(motion, positions, self.stab_from_raw)
        chosen = self._choice()
        if chosen != Hypothesis.STILL or self.stab_from_raw is not IDENTITY:
            angle = _angle(self.stab_from_raw)
            if self._config.turn and chosen in _WITH_CAMERA:
                angle -= rigid_parameters(cur_from_prev, self._center)[2]
            self.stab_from_raw = self._view(angle, positions[chosen])
        return self._box_at(positions[chosen])

    def observe(self, xywh: XYWH, score: float) -> None:
        """Update with the tracker's box in the raw frame and its `score` 0..1.

        A low-score box has half the weight in the errors, and none in the speed. Without any weight
        in the errors, a camera that follows a target of changing appearance would be mistaken for a
        shaking one.
        """
        config, step = self._config, self._step
        has_low_score = config.trust and score < _LOW_SCORE
        if has_low_score:
            in_frame, in_scene = self._speeds
            self._speeds = _slower(in_frame), _slower(in_scene)
        if step is not None and step.motion.reliable:
            center, size = _center(xywh), self._size
            memory = config.memory ** (_LOW_SCORE_WEIGHT if has_low_score else 1.0)
            self._errors = [
                memory * error + (1 - memory) * min(_distance(position, center) / size, _MAX_ERROR)
                for error, position in zip(self._errors, step.positions, strict=True)
            ]
            self._missing_error *= memory
            if not has_low_score:
                in_frame, in_scene = self._speeds
                self._speeds = (
                    self._updated_speed(in_frame, step.positions[Hypothesis.STILL], center),
                    self._updated_speed(in_scene, step.positions[Hypothesis.FIXED], center),
                )
        self._elapsed = 1
        self._set_box(xywh)

    def hold(self) -> XYWH:
        """Skip the frame of the last `update`, which is blank: keep errors and speed.

        The target is assumed to be fixed in the scene, and the view shows it at its last position.
        Returns its box, raw-frame pixels.
        """
        if self._step is not None:
            motion, self.stab_from_raw = self._step.motion, self._step.prev_stab_from_raw
            self._elapsed += 1
            if motion.reliable:
                cur_from_prev = motion.at(self._center)
                # A similarity's zoom and a homography's tilt would change the size of the target.
                shift_angle = rigid_parameters(cur_from_prev, self._center)
                prev_from_cur = inverse(rigid(*shift_angle, self._center))
                self.stab_from_raw = self.stab_from_raw @ prev_from_cur
                self._center = map_point(cur_from_prev, *self._center)
            self._step = None
        return self._box_at(self._center)

    @property
    def traveled(self) -> tuple[float, float]:
        """Distance (dx, dy) in the scene since the last box at constant speed; pixels."""
        _, (dx, dy) = self._speeds
        return dx * (self._elapsed - 1), dy * (self._elapsed - 1)

    @property
    def error(self) -> float:
        """Recent error of the best prediction, target sizes; .3 before the first frame."""
        still, moving, fixed, moving_in_scene = self._errors
        return min(still, moving, min(fixed, moving_in_scene) + self._missing_error)

    @property
    def _size(self) -> float:
        """Size of the target: the square root of its area, pixels."""
        return math.sqrt(self._box[2] * self._box[3])

    def _set_box(self, xywh: XYWH) -> None:
        self._box, self._center, self._step = xywh, _center(xywh), None

    def _box_at(self, center: Point) -> XYWH:
        (x, y), (_, _, w, h) = center, self._box
        return x - w / 2, y - h / 2, w, h

    def _predict(self, cur_from_prev: Transform) -> tuple[Point, ...]:
        """The target center predicted by each hypothesis, raw-frame pixels."""
        x, y = self._center
        u, v = map_point(cur_from_prev, x, y)
        (dx, dy), (du, dv) = self._speeds if self._config.speed else _STANDING
        return (x, y), (x + dx, y + dy), (u, v), (u + du, v + dv)

    def _updated_speed(self, speed: Point, expected: Point, center: Point) -> Point:
        """Running mean of the speed of a target that was expected elsewhere, px per frame."""
        (dx, dy), (x, y), (new_x, new_y) = speed, expected, center
        gain = 1 - self._config.smoothing
        return (
            dx + gain * ((new_x - x) / self._elapsed - dx),
            dy + gain * ((new_y - y) / self._elapsed - dy),
        )

    def _choice(self) -> Hypothesis:
        """The hypothesis with the least error, if it is clearly better than `STILL`."""
        if not self._config.choose:
            return Hypothesis.MOVING_IN_SCENE
        least = min(self._errors)
        if least + self._config.margin < self._errors[Hypothesis.STILL]:
            return Hypothesis(self._errors.index(least))
        return Hypothesis.STILL

    def _view(self, angle: float, position: Point) -> Transform:
        """The view that shows the raw-frame `position` where the last view shows the target.

        A small step back toward the raw frame keeps the view from drifting away, so that rendered
        frames still show the area of the raw frame. The rotation has a limit, because the target
        may not turn with the scene.
        """
        (x, y), step = position, _MAX_RETURN_STEP * self._size
        last_x, last_y = map_point(self.stab_from_raw, *self._center)
        dx, dy = (
            offset - max(-step, min(_RETURN * offset, step)) for offset in (last_x - x, last_y - y)
        )
        angle = math.remainder(angle, math.tau) * (1 - _RETURN)
        angle = max(-_MAX_TURN, min(angle, _MAX_TURN))
        if max(abs(dx) / self._size, abs(dy) / self._size, abs(angle)) < _MIN_OFFSET:
            return IDENTITY
        return rigid(dx, dy, angle, (x, y))


def _center(xywh: XYWH) -> Point:
    x, y, w, h = xywh
    return x + w / 2, y + h / 2


def _distance(first: Point, second: Point) -> float:
    dx, dy = first[0] - second[0], first[1] - second[1]
    return math.sqrt(dx * dx + dy * dy)


def _slower(speed: Point) -> Point:
    return speed[0] * (1 - _SPEED_LOSS), speed[1] * (1 - _SPEED_LOSS)


def _angle(to_from_from: Transform) -> float:
    """Rotation of a transform, radians clockwise on screen."""
    (a, b, _), (c, d, _), _ = to_from_from.tolist()
    return math.atan2(c - b, a + d)
