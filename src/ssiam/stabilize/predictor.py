"""`Prediction`: the view in which the target lies where the tracker last saw it.

A Siamese tracker looks for its target around the place where it was. The camera's motion and the
target's own tell where it will be: the frame is shown so that this place comes to lie where the
tracker will look. Four predictions compete, and "where it was" wins unless another one has been
clearly better of late: where nothing shakes nothing is changed.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.geometry import IDENTITY, XYWH, Transform, map_point, rigid
from ssiam.motion import Motion
from ssiam.stabilize.config import PredictConfig

Point = NDArray[np.float64]

_FARTHEST: Final = 2.0  # target sizes; a prediction that was farther off counts as this far off
_TRUSTED: Final = 0.15  # score from which a tracker's box tells the target's speed
_CAUTION: Final = 0.3  # target sizes by which a picture is at first believed to shake
_HALF: Final = 0.5  # of a frame, for which a doubtful box counts
_FORGET: Final = 0.5  # share of its speed that a target loses in each frame without trust
# A view comes back towards the raw frame: by a share of its shift and turn in each frame, and by
# no more than a tracker hardly notices.
_HOME: Final = 0.05
_HOME_STEP: Final = 0.1  # target sizes
_AT_HOME: Final = 0.01  # target sizes, and radians


class Hypothesis(IntEnum):
    """Where the target will be."""

    STILL = 0  # where it was in the picture
    MOVING = 1  # onwards, as it last moved in the picture
    FIXED = 2  # where it was in the scene
    MOVING_IN_SCENE = 3  # onwards, as it last moved in the scene


_TURNING: Final = (Hypothesis.FIXED, Hypothesis.MOVING_IN_SCENE)


class TargetPredictor(DeepCopied):
    """Chooses ``stab_from_raw`` by where the target will be, one frame at a time.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    config : PredictConfig
        `choose`, `speed`, `turn`, `trust`, `memory`, `smoothing` and `margin` of it.
    xywh : (x, y, w, h)
        The target in the first frame, raw-frame pixels.
    """

    def __init__(self, config: PredictConfig, xywh: XYWH) -> None:
        self._config = config
        self.stab_from_raw: Transform = IDENTITY
        # Running means, target sizes. At first the camera is believed: a shake can lose the target
        # in one frame, a pan that follows it cannot.
        self._errors = np.array([_CAUTION, _CAUTION, 0.0, 0.0])
        self._reliable = False
        self._centre: Point = _centre(xywh)
        self._size_wh: tuple[float, float] = xywh[2:]
        self._elapsed = 1  # frames since the target was seen
        self._before: tuple[Transform, Motion] = IDENTITY, Motion.none((0, 0))
        self.move_to(xywh)

    def move_to(self, xywh: XYWH) -> None:
        """The target is in `xywh`, wherever it was thought to be; nothing is known of its speed."""
        self._take(xywh)
        self._speeds = np.zeros((2, 2))  # px per frame: in the picture, in the scene

    def update(self, motion: Motion) -> XYWH:
        """Where the target will be in the next frame, reached by `motion`; raw-frame pixels.

        `stab_from_raw` is then that frame's view.
        """
        self._reliable = motion.reliable
        self._before = self.stab_from_raw, motion
        self._places = self._predicted(motion)
        chosen = self._choice()
        angle = _angle(self.stab_from_raw)
        if self._config.turn and chosen in _TURNING:
            angle -= _angle(motion.cur_from_prev)
        if chosen != Hypothesis.STILL or self.stab_from_raw is not IDENTITY:
            self.stab_from_raw = self._shown(angle, self._places[chosen])
        (x, y), (w, h) = self._places[chosen].tolist(), self._size_wh
        return x - w / 2, y - h / 2, w, h

    def observe(self, xywh: XYWH, score: float) -> None:
        """The tracker has seen the target in `xywh` of the raw frame, with `score` 0..1.

        Where it hardly believes so, its box counts for half of what it tells about the predictions
        (for nothing, a camera that goes with a target which looks another every moment would be
        taken for a shaking one), and tells nothing about the target's speed.
        """
        config, centre = self._config, _centre(xywh)
        doubtful = config.trust and score < _TRUSTED
        if doubtful:
            self._speeds *= 1 - _FORGET
        if self._reliable:
            off = np.linalg.norm(self._places - centre, axis=1) / self._size
            keep = config.memory ** (_HALF if doubtful else 1.0)
            self._errors = keep * self._errors + (1 - keep) * np.minimum(off, _FARTHEST)
            if not doubtful:
                moved = centre - self._places[[Hypothesis.STILL, Hypothesis.FIXED]]
                self._speeds += (1 - config.smoothing) * (moved / self._elapsed - self._speeds)
        self._elapsed = 1
        self._take(xywh)

    def hold(self) -> XYWH:
        """The frame of the last `update` shows nothing of the target: keep everything as it was.

        The target is taken to be fixed in the scene, and the view shows it where it was.
        Returns its box, raw-frame pixels.
        """
        self.stab_from_raw, motion = self._before
        self._elapsed += 1
        if motion.reliable:
            x, y = self._centre.tolist()
            self._centre = np.array(map_point(motion.cur_from_prev, x, y))
            self.stab_from_raw = self.stab_from_raw @ np.linalg.inv(motion.cur_from_prev)
        (x, y), (w, h) = self._centre.tolist(), self._size_wh
        return x - w / 2, y - h / 2, w, h

    @property
    def traveled(self) -> tuple[float, float]:
        """How far the target went in the scene since it was seen, if it kept its speed; pixels."""
        x, y = (self._speeds[1] * (self._elapsed - 1)).tolist()
        return x, y

    def _take(self, xywh: XYWH) -> None:
        self._centre, self._size_wh = _centre(xywh), xywh[2:]
        self._size = math.sqrt(xywh[2] * xywh[3])

    def _predicted(self, motion: Motion) -> Point:
        """Where each hypothesis (4, 2) expects the target, raw-frame pixels."""
        still = self._centre
        fixed = np.array(map_point(motion.cur_from_prev, *still.tolist()))
        in_picture, in_scene = self._speeds if self._config.speed else np.zeros((2, 2))
        return np.array([still, still + in_picture, fixed, fixed + in_scene])

    def _choice(self) -> Hypothesis:
        if not self._config.choose:
            return Hypothesis.MOVING_IN_SCENE
        best = Hypothesis(int(np.argmin(self._errors)))
        better = self._errors[best] + self._config.margin < self._errors[Hypothesis.STILL]
        return best if better else Hypothesis.STILL

    def _shown(self, angle: float, place: Point) -> Transform:
        """The view, turned, in which the raw-frame `place` lies where the target was seen.

        Less a little, so that it does not wander off: whole pictures show no more than the raw
        frame's own place.
        """
        (x, y), step = place.tolist(), _HOME_STEP * self._size
        seen_x, seen_y = map_point(self.stab_from_raw, *self._centre.tolist())
        dx, dy = (away - max(-step, min(_HOME * away, step)) for away in (seen_x - x, seen_y - y))
        angle = math.remainder(angle, math.tau) * (1 - _HOME)
        if max(abs(dx) / self._size, abs(dy) / self._size, abs(angle)) < _AT_HOME:
            return IDENTITY
        return rigid(dx, dy, angle, (x, y))


def _centre(xywh: XYWH) -> Point:
    x, y, w, h = xywh
    return np.array([x + w / 2, y + h / 2])


def _angle(to_from_from: Transform) -> float:
    """How far a transform turns, radians clockwise on screen."""
    (a, b, _), (c, d, _), _ = to_from_from.tolist()
    return math.atan2(c - b, a + d)
