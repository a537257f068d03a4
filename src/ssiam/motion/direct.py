"""The camera's motion straight from the pixels: every part of the picture has its say.

Keypoints gather on the most textured thing in view, and each is found alone, by its own few
pixels. Here samples all over the picture are aligned at once, for one transform: at 80 pixels,
from a start that the picture's blocks vote for, then at 320 pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.motion.alignment import Aligned, Rules, align
from ssiam.motion.cells import Floats, Grid, Template
from ssiam.motion.content import flat_outside, shows_nothing, without_rim
from ssiam.motion.models import ModelName
from ssiam.motion.motion import Motion, plausible
from ssiam.motion.overlays import Overlays
from ssiam.motion.pictures import Picture, Scales
from ssiam.motion.start import CoarseStart

# Where nobody tells what moves by itself, every cell counts the same, and must agree more closely.
_TOLD: Final = Rules(noise=2.0, tolerance=0.3, evenness=0.3, rounds=4, enough=5e-4)
_UNTOLD: Final = replace(_TOLD, evenness=1.0, tolerance=0.1)

_STRIDE: Final = 2  # px of the fine picture between samples
_SIDE: Final = 8  # samples along each side of a cell
_RELIABLE: Final = (
    0.25  # share of the texture that must be explained (benchmarks/calibration/reliability.py)
)
_AGREES: Final = 0.5  # share of a cell's texture that is explained when it agrees
_TELLING: Final = 8  # cells that must agree
_SPREAD: Final = 0.3  # units over which they must be spread
_TINY: Final = 1e-3
_LEFT: Final = 0.3  # share of the textured cells that must be left beside flat areas
_TOUCHED: Final = 0.02  # share of a cell that the rim of a flat area may cover


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is kept of a frame."""

    picture: Picture
    coarse: Template
    fine: Template
    scene: Floats | None = None  # (cells,) of `fine`, 0 beside a flat area at the outline, else 1
    coarse_scene: Floats | None = None  # the same of `coarse`


class DirectMotion:
    """Camera motion of frames of one size, by direct alignment."""

    def __init__(self, size_wh: tuple[int, int], model: ModelName) -> None:
        self._size_wh = size_wh
        self._scales = scales = Scales(size_wh)
        self._start = CoarseStart(scales)
        self._grid = Grid(scales.fine_wh, scales.fine_from_unit, _STRIDE, _SIDE, model)
        self._overlays = Overlays(self._grid)
        self._too_small = self._start.grid.cells == 0
        self._prev: _Seen | None = None

    def see(self, frame: Image) -> None:
        """Take a frame (H, W, 3) uint8 as the previous one."""
        if not self._too_small:
            self._prev = self._seen(frame)

    def motion(self, frame: Image, boxes: NDArray[np.float64]) -> Motion:
        """From the previous frame to this one; `boxes` (N, 4), low xy, high xy, are left out.

        Frames that show nothing are passed over: the motion to the one after them is that from
        the last one that showed something.
        """
        if self._too_small:
            return Motion.none(self._size_wh)
        cur, prev = self._seen(frame), self._prev
        if prev is None:
            self._prev = cur
            return Motion.none(self._size_wh, reliable=True)
        if shows_nothing(cur.picture.coarse):
            return Motion.none(self._size_wh)
        self._prev = cur
        unit_boxes = self._scales.in_units(boxes)
        shown = self._overlays.background
        start = self._start.find(
            (prev.picture, prev.coarse),
            (cur.picture, cur.coarse),
            unit_boxes,
            shown.reshape(self._grid.shape),
            prev.coarse_scene,
        )
        keep = self._grid.background(unit_boxes) * shown
        if prev.scene is not None:
            keep *= prev.scene
        rules = _TOLD if len(boxes) else _UNTOLD
        aligned = align(prev.fine, cur.picture.fine, start, keep, rules)
        motion = self._judged(prev.fine, aligned, keep)
        if motion.reliable:
            self._overlays.update(prev.fine, cur.fine, aligned.cur_from_prev, aligned.error)
        return motion

    def _seen(self, frame: Image) -> _Seen:
        picture = self._scales.picture(frame)
        fine = Template(picture.fine, self._grid)
        outside = flat_outside(picture.fine)
        if outside is None:
            return _Seen(picture, self._start.template(picture.coarse), fine)
        inside = without_rim(outside)
        scene = self._grid.covered(inside) >= 1 - _TOUCHED
        if (scene & fine.textured).sum() < _LEFT * fine.textured.sum():
            return _Seen(picture, self._start.template(picture.coarse), fine)
        filled = picture.fine.copy()
        filled[outside > 0] = round(cv2.mean(filled, inside)[0])
        picture = self._scales.pyramid(filled)
        coarse_wh = self._scales.coarse_wh
        coarse_inside = np.asarray(
            cv2.resize(inside, coarse_wh, interpolation=cv2.INTER_AREA), dtype=np.uint8
        )
        return _Seen(
            picture,
            self._start.template(picture.coarse),
            fine,
            scene.astype(np.float32),
            (self._start.grid.covered(coarse_inside) >= 1 - _TOUCHED).astype(np.float32),
        )

    def _judged(self, template: Template, aligned: Aligned, keep: Floats) -> Motion:
        """The motion in pixels of the frame, if there is good evidence for it."""
        telling = keep * template.textured
        explained = telling * np.maximum(1 - aligned.error / (template.texture + _TINY), 0)
        share = float(explained.sum()) / max(float(telling.sum()), _TINY)
        x, y = self._grid.centres.compress(explained > _AGREES, axis=1)
        scales = self._scales
        cur_from_prev = scales.frame_from_unit @ aligned.cur_from_prev @ scales.unit_from_frame
        motion = Motion(cur_from_prev, share, True, self._size_wh)
        sure = (
            share >= _RELIABLE
            and len(x) >= _TELLING
            and max(x.max() - x.min(), y[-1] - y[0]) >= _SPREAD  # cells lie row by row
        )
        return motion if sure and plausible(motion) else Motion.none(self._size_wh)
