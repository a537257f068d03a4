"""`SceneMemory`: small pictures of the scenes in which the target was, and where it was in them.

After a cut or a long pan, the camera's motion does not tell where the target was last seen. If the
frame shows a known scene again, its shift against the picture of that scene does.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.geometry import XYWH, Image

_SIDE: Final = 64  # px, width of a picture
_SAMPLES: Final = 4  # pixels of a frame along each side of a pixel of a picture
_INTERVAL: Final = 20  # frames between two pictures
_MAX_SCENES: Final = 8
_SAME_SCENE: Final = 0.3  # of a side, maximum shift of a picture that replaces the last one
_MIN_CORRELATION: Final = 0.6  # of two pictures of one scene, where they overlap
_MAX_SHIFT: Final = 0.6  # of a side

Picture = NDArray[np.float32]


class _Scene(NamedTuple):
    picture: Picture
    xywh: XYWH  # the target in it, raw-frame pixels


class SceneMemory(DeepCopied):
    """Scenes in which the target was seen.

    Threads: one thread at a time for each object; several objects are independent.
    """

    def __init__(self) -> None:
        self._scenes: list[_Scene] = []
        self._age = _INTERVAL  # frames since the last picture was taken
        self._turn = 0

    def observe(self, frame: Image, xywh: XYWH) -> None:
        """Take a picture of a frame in which the target is in `xywh`, at most one in twenty."""
        self._age += 1
        if self._age < _INTERVAL:
            return
        self._age = 0
        scene = _Scene(_picture(frame), xywh)
        if self._scenes:
            shift = _shift(self._scenes[-1].picture, scene.picture)
            if shift is not None and max(map(abs, shift)) < _SAME_SCENE:
                self._scenes.pop()
        # The first scene is always kept.
        self._scenes = [*self._scenes[:1], *self._scenes[1:][-(_MAX_SCENES - 2) :], scene]

    def find(self, frame: Image) -> XYWH | None:
        """Compare `frame` with one known scene: every second time the last one, else all in turn.

        Returns
        -------
        (x, y, w, h) or None
            Where the target was in that scene, pixels of `frame`; None if another one is shown.
        """
        if not self._scenes:
            return None
        self._turn += 1
        scene = self._scenes[-1]
        if self._turn % 2 == 0:
            scene = self._scenes[self._turn // 2 % len(self._scenes)]
        shift = _shift(scene.picture, _picture(frame))
        if shift is None:
            return None
        x, y, w, h = scene.xywh
        return x + shift[0] * frame.shape[1], y + shift[1] * frame.shape[0], w, h


def _picture(frame: Image) -> Picture:
    height, width = frame.shape[:2]
    rows = max(round(_SIDE * height / width), 8)
    step = max(width // (_SIDE * _SAMPLES), 1)
    few_wh = width // step, max(height // step, 1)
    sampled = cv2.resize(frame, few_wh, interpolation=cv2.INTER_NEAREST)
    small = cv2.resize(sampled, (_SIDE, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.float32)


def _shift(first: Picture, second: Picture) -> tuple[float, float] | None:
    """Shift from the first picture to the second, in sides; None if they show different scenes."""
    rows, columns = first.shape
    window = cv2.createHanningWindow((columns, rows), cv2.CV_32F)
    (x, y), _ = cv2.phaseCorrelate(first - first.mean(), second - second.mean(), window)
    dx, dy = round(x), round(y)
    if abs(dx) > _MAX_SHIFT * columns or abs(dy) > _MAX_SHIFT * rows:
        return None
    one = first[max(-dy, 0) : rows - max(dy, 0), max(-dx, 0) : columns - max(dx, 0)]
    other = second[max(dy, 0) : rows + min(dy, 0), max(dx, 0) : columns + min(dx, 0)]
    deviation = float(one.std() * other.std())
    if deviation < 1:
        return None
    correlation = float(((one - one.mean()) * (other - other.mean())).mean()) / deviation
    return (x / columns, y / rows) if correlation > _MIN_CORRELATION else None
