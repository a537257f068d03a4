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

import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.geometry import (
    IDENTITY,
    XYWH,
    Points,
    Transform,
    map_point,
    rigid,
    rigid_parameters,
)
from ssiam.motion import Motion
from ssiam.stabilize.config import PredictConfig

Point = NDArray[np.float64]  # (2,) x, y in pixels

_MAX_ERROR: Final = 2.0  # target sizes; larger errors of a prediction are cut off
_LOW_SCORE: Final = 0.15  # a box with a lower score does not update the target's speed
_INITIAL_ERROR: Final = 0.3  # target sizes, of the predictions without camera motion
_LOW_SCORE_WEIGHT: Final = 0.5  # weight, in frames, of a low-score box
_SPEED_LOSS: Final = 0.5  # share of its speed that a target loses in each low-score frame
# In each frame the view returns toward the raw frame by a share of its shift and rotation. The step
# is limited to what trackers tolerate.
_RETURN: Final = 0.05  # share
_MAX_RETURN_STEP: Final = 0.1  # target sizes
_MIN_OFFSET: Final = 0.01  # target sizes, and radians: below it the view is the raw frame


class Hypothesis(IntEnum):
    """Predictions of the target's next position."""

    STILL = 0  # same position in the frame
    MOVING = 1  # same velocity in the frame
    FIXED = 2  # same position in the scene
    MOVING_IN_SCENE = 3  # same velocity in the scene


_WITH_CAMERA: Final = (Hypothesis.FIXED, Hypothesis.MOVING_IN_SCENE)


@dataclass(frozen=True, eq=False)
class _Step:
    """A frame after `update` and before `observe` or `hold`."""

    motion: Motion
    positions: Points  # (4, 2) predicted centers by `Hypothesis`, raw-frame pixels
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
        self._errors = np.array([_INITIAL_ERROR, _INITIAL_ERROR, 0.0, 0.0])
        self._speeds = np.zeros((2, 2))  # px per frame: in the frame, in the scene
        self._elapsed = 1  # frames since the last box
        self._step: _Step | None = None
        self._box = xywh
        self._center = _center(xywh)

    def move_to(self, xywh: XYWH) -> None:
        """Set the target's box (raw-frame pixels) and a speed of 0; the errors are kept."""
        self._set_box(xywh)
        self._speeds = np.zeros((2, 2))

    def coast(self, xywh: XYWH) -> None:
        """Set the assumed box (raw-frame pixels) of a hidden target; speed and errors are kept."""
        self._elapsed = 1
        self._set_box(xywh)

    def update(self, motion: Motion) -> XYWH:
        """Predict the box in the next frame, reached by `motion`; raw-frame pixels.

        Also sets `stab_from_raw` to the view of that frame.
        """
        positions = self._predict(motion)
        self._step = _Step(motion, positions, self.stab_from_raw)
        chosen = self._choice()
        angle = _angle(self.stab_from_raw)
        if self._config.turn and chosen in _WITH_CAMERA:
            angle -= self._rigid_at_target(motion)[2]
        if chosen != Hypothesis.STILL or self.stab_from_raw is not IDENTITY:
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
            self._speeds *= 1 - _SPEED_LOSS
        if step is not None and step.motion.reliable:
            center = _center(xywh)
            errors = np.linalg.norm(step.positions - center, axis=1) / self._size
            memory = config.memory ** (_LOW_SCORE_WEIGHT if has_low_score else 1.0)
            self._errors = memory * self._errors + (1 - memory) * np.minimum(errors, _MAX_ERROR)
            if not has_low_score:
                moved = center - step.positions[[Hypothesis.STILL, Hypothesis.FIXED]]
                self._speeds += (1 - config.smoothing) * (moved / self._elapsed - self._speeds)
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
                x, y = self._center.tolist()
                cur_from_prev = rigid(*self._rigid_at_target(motion), (x, y))
                self._center = np.array(map_point(motion.at((x, y)), x, y))
                self.stab_from_raw = self.stab_from_raw @ np.linalg.inv(cur_from_prev)
            self._step = None
        return self._box_at(self._center)

    @property
    def traveled(self) -> tuple[float, float]:
        """Distance (dx, dy) in the scene since the last box at constant speed; pixels."""
        x, y = (self._speeds[1] * (self._elapsed - 1)).tolist()
        return x, y

    @property
    def error(self) -> float:
        """Recent error of the best prediction, target sizes."""
        return float(self._errors.min())

    @property
    def _size(self) -> float:
        """Size of the target: the square root of its area, pixels."""
        return math.sqrt(self._box[2] * self._box[3])

    def _set_box(self, xywh: XYWH) -> None:
        self._box, self._center, self._step = xywh, _center(xywh), None

    def _box_at(self, center: Point) -> XYWH:
        (x, y), (w, h) = center.tolist(), self._box[2:]
        return x - w / 2, y - h / 2, w, h

    def _rigid_at_target(self, motion: Motion) -> tuple[float, float, float]:
        """Shift (pixels) and rotation (radians) of the background at the target: views are rigid.

        A similarity's zoom and a homography's tilt would change the size of the target.
        """
        x, y = self._center.tolist()
        return rigid_parameters(motion.at((x, y)), (x, y))

    def _predict(self, motion: Motion) -> Points:
        """The target center (4, 2) predicted by each hypothesis, raw-frame pixels."""
        still = self._center
        x, y = still.tolist()
        fixed = np.array(map_point(motion.at((x, y)), x, y))
        in_frame, in_scene = self._speeds if self._config.speed else np.zeros((2, 2))
        return np.array([still, still + in_frame, fixed, fixed + in_scene])

    def _choice(self) -> Hypothesis:
        """The hypothesis with the least error, if it is clearly better than `STILL`."""
        if not self._config.choose:
            return Hypothesis.MOVING_IN_SCENE
        best = Hypothesis(int(np.argmin(self._errors)))
        better = self._errors[best] + self._config.margin < self._errors[Hypothesis.STILL]
        return best if better else Hypothesis.STILL

    def _view(self, angle: float, position: Point) -> Transform:
        """The view that shows the raw-frame `position` where the last view shows the target.

        A small step back toward the raw frame keeps the view from drifting away, so that rendered
        frames still show the area of the raw frame.
        """
        (x, y), step = position.tolist(), _MAX_RETURN_STEP * self._size
        last_x, last_y = map_point(self.stab_from_raw, *self._center.tolist())
        dx, dy = (
            offset - max(-step, min(_RETURN * offset, step)) for offset in (last_x - x, last_y - y)
        )
        angle = math.remainder(angle, math.tau) * (1 - _RETURN)
        if max(abs(dx) / self._size, abs(dy) / self._size, abs(angle)) < _MIN_OFFSET:
            return IDENTITY
        return rigid(dx, dy, angle, (x, y))


def _center(xywh: XYWH) -> Point:
    x, y, w, h = xywh
    return np.array([x + w / 2, y + h / 2])


def _angle(to_from_from: Transform) -> float:
    """Rotation of a transform, radians clockwise on screen."""
    (a, b, _), (c, d, _), _ = to_from_from.tolist()
    return math.atan2(c - b, a + d)
