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

from ssiam.geometry import IDENTITY, Image, Transform
from ssiam.motion.alignment import Aligned, Rules, agreement_of, align
from ssiam.motion.cells import Floats, Grid, Template, variance
from ssiam.motion.models import ModelName
from ssiam.motion.motion import Motion, plausible
from ssiam.motion.overlays import Overlays
from ssiam.motion.pictures import Picture, Scales
from ssiam.motion.vote import voted_shift

_COARSE: Final = Rules(noise=1.0, tolerance=0.3, evenness=0.5, rounds=8, enough=2e-3)
_FINE: Final = Rules(noise=2.0, tolerance=0.3, evenness=0.3, rounds=4, enough=5e-4)
# Where nobody says what moves by itself, every cell counts the same, and must agree more closely.
_COARSE_BLIND: Final = replace(_COARSE, evenness=1.0, rounds=16, enough=1e-3, tightening=0.8)
_FINE_BLIND: Final = replace(_FINE, evenness=1.0, tolerance=0.1)

_STRIDE: Final = 3  # px of the fine picture between samples
_GROW: Final = 0.10  # of a box's size, added on each side: its edges move with it
_LEAST: Final = 0.5  # share of a cell that must be background
_SURE: Final = 0.5  # share of the coarse cells that must agree, or another start is tried
_DISAGREES: Final = 0.3  # agreement below which a cell may belong to something else
_ENOUGH_LEFT: Final = 0.15  # share of the cells that must be left for another start
_RELIABLE: Final = 0.25  # share of the texture that must be explained (benchmarks/motion.py)
_AGREES: Final = 0.5  # share of a cell's texture that is explained when it agrees
_TELLING: Final = 8  # cells that must agree
_SPREAD: Final = 0.3  # units over which they must be spread
_TINY: Final = 1e-3


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is kept of the previous frame."""

    picture: Picture
    coarse: Template
    fine: Template


class DirectMotion:
    """Camera motion of frames of one size, by direct alignment."""

    def __init__(self, size_wh: tuple[int, int], model: ModelName) -> None:
        self._size_wh = size_wh
        self._scales = scales = Scales(size_wh)
        coarse_wh, fine_wh = scales.picture_sizes
        self._coarse = Grid(coarse_wh, scales.coarse_from_unit, 1, "rigid")
        self._fine = Grid(fine_wh, scales.fine_from_unit, _STRIDE, model)
        self._overlays = Overlays(self._fine)
        self._prev: _Seen | None = None

    def see(self, frame: Image) -> None:
        """Take a frame (H, W, 3) uint8 as the previous one."""
        if self._coarse.cells == 0:
            return
        picture = self._scales.picture(frame)
        coarse, fine = Template(picture.coarse, self._coarse), Template(picture.fine, self._fine)
        self._prev = _Seen(picture, coarse, fine)

    def motion(self, frame: Image, boxes: NDArray[np.float64]) -> Motion:
        """From the previous frame to this one; `boxes` (N, 4) xywh are left out."""
        if self._coarse.cells == 0:
            return Motion.none(self._size_wh)
        prev = self._prev
        self.see(frame)
        cur = self._prev
        if prev is None or cur is None:
            return Motion.none(self._size_wh, reliable=True)
        keep = self._background(self._fine, boxes) * self._overlays.background
        blind = len(boxes) == 0
        start = self._begin(prev, cur, boxes, _COARSE_BLIND if blind else _COARSE)
        rules = _FINE_BLIND if blind else _FINE
        aligned = align(prev.fine, cur.picture.fine, start, keep, rules)
        motion = self._judged(prev.fine, aligned, keep)
        if motion.reliable:
            self._overlays.update(prev.fine, cur.fine, aligned.cur_from_prev, aligned.error)
        return motion

    def _begin(
        self, prev: _Seen, cur: _Seen, boxes: NDArray[np.float64], rules: Rules
    ) -> Transform:
        """cur_from_prev in units, from the coarse pictures."""
        shape = self._coarse.shape
        overlays = self._overlays.background.reshape(self._fine.shape)
        shown = cv2.resize(overlays, shape[::-1], interpolation=cv2.INTER_AREA).ravel()
        background = keep = self._background(self._coarse, boxes) * shown
        counted = background * prev.coarse.textured
        counted /= max(float(counted.sum()), _TINY)
        change = variance(cur.coarse.values - prev.coarse.values)
        still = agreement_of(change, prev.coarse.texture, rules.noise, rules.tolerance)
        moved = bool(still @ counted < _SURE)
        best, best_share = IDENTITY, -1.0
        for _ in range(2):
            start = self._voted(prev.picture, cur.picture, keep) if moved else IDENTITY
            aligned = align(prev.coarse, cur.picture.coarse, start, keep, rules)
            share = float(aligned.agreement @ counted)
            if share > best_share:
                best, best_share = aligned.cur_from_prev, share
            if share >= _SURE:
                break
            around = cv2.dilate(aligned.agreement.reshape(shape), np.ones((3, 3), np.uint8))
            keep, moved = keep * (around.ravel() < _DISAGREES), True
            if keep.mean() < _ENOUGH_LEFT:
                break
        return best

    def _voted(self, prev: Picture, cur: Picture, keep: Floats) -> Transform:
        shift_xy = voted_shift(prev.tiny, cur.tiny, keep.reshape(self._coarse.shape))
        start = np.eye(3)
        start[:2, 2] = shift_xy / np.diag(self._scales.tiny_from_unit)[:2]
        return start

    def _background(self, grid: Grid, boxes: NDArray[np.float64]) -> Floats:
        """Share (cells,) of each cell outside of the boxes, 0 where it is less than half."""
        keep = np.ones(grid.cells, dtype=np.float32)
        (scale, _, left), (_, _, top) = self._scales.frame_from_unit[:2].tolist()
        for x, y, w, h in boxes.tolist():
            low_xy = (x - _GROW * w - left) / scale, (y - _GROW * h - top) / scale
            high_xy = (x + (1 + _GROW) * w - left) / scale, (y + (1 + _GROW) * h - top) / scale
            keep *= grid.outside(low_xy, high_xy)
        if len(boxes):
            keep[keep < _LEAST] = 0
        return keep

    def _judged(self, template: Template, aligned: Aligned, keep: Floats) -> Motion:
        """The motion in pixels of the frame, if there is good evidence for it."""
        telling = keep * template.textured
        explained = telling * np.maximum(1 - aligned.error / (template.texture + _TINY), 0)
        share = float(explained.sum()) / max(float(telling.sum()), _TINY)
        agreeing = self._fine.centres[:, explained > _AGREES]
        scales = self._scales
        cur_from_prev = scales.frame_from_unit @ aligned.cur_from_prev @ scales.unit_from_frame
        motion = Motion(cur_from_prev, share, True, self._size_wh)
        sure = (
            share >= _RELIABLE
            and agreeing.shape[1] >= _TELLING
            and np.ptp(agreeing, axis=1).max() >= _SPREAD
        )
        return motion if sure and plausible(motion) else Motion.none(self._size_wh)
