"""The coarse motion estimate, from which the fine alignment starts."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import IDENTITY, Image, Transform
from ssiam.motion.alignment import Rules, agreement_of, align
from ssiam.motion.cells import Floats, Grid, Template
from ssiam.motion.pyramid import Picture, Scales

_TOLD: Final = Rules(noise=1.0, tolerance=0.3, evenness=0.5, rounds=8, enough=2e-3)
_UNTOLD: Final = replace(_TOLD, evenness=1.0, rounds=16, enough=1e-3, tightening=0.8)

_SURE: Final = 0.5  # share of the textured cells that must agree, or another start is tried
_DISAGREES: Final = 0.3  # agreement below which a cell may belong to something else
_ENOUGH_LEFT: Final = 0.15  # share of the cells that must be left for another start
_NEIGHBOURS: Final = np.ones((3, 3), np.uint8)
_TINY: Final = 1e-3


class CoarseStart:
    """Rigid motion of frames of one size at 80 pixels, from a start that blocks vote for."""

    def __init__(self, scales: Scales) -> None:
        self._scales = scales
        self.grid = Grid(scales.coarse_wh, scales.coarse_from_unit, stride=1, side=5, model="rigid")

    def template(self, picture: Image) -> Template:
        """Of a coarse picture."""
        return Template(picture, self.grid)

    def find(
        self,
        prev: tuple[Picture, Template],
        cur: tuple[Picture, Template],
        boxes: NDArray[np.float64],
        shown: Floats,
        scene: Floats | None = None,
    ) -> Transform:
        """cur_from_prev in units.

        Where most cells disagree with what was found, the largest thing that moves by itself may
        have won: a second start is made from the disagreeing cells, and the motion that more of
        the picture agrees with is kept.

        Parameters
        ----------
        prev, cur : (Picture, Template)
            Of the previous frame and this one.
        boxes : (N, 4) float64
            Left out: low x, low y, high x, high y in units.
        shown : (rows, columns) float32
            0 where something is drawn over the picture, else 1; any grid over the picture.
        scene : (cells,) float32, optional
            0 for cells that do not show the scene, else 1.
        """
        (prev_picture, template), (cur_picture, cur_template) = prev, cur
        rules = _TOLD if len(boxes) else _UNTOLD
        shape = self.grid.shape
        overlays = cv2.resize(shown, shape[::-1], interpolation=cv2.INTER_AREA)
        keep = self.grid.background(boxes) * overlays.ravel()
        if scene is not None:
            keep *= scene
        counted = keep * template.textured
        counted /= max(float(counted.sum()), _TINY)
        tolerated = rules.tolerated(template.texture)
        still = agreement_of(template.change_to(cur_template), tolerated)
        moved = bool(still @ counted < _SURE)
        best, best_share = IDENTITY, -1.0
        for _ in range(2):
            start = self._voted(prev_picture.tiny, cur_picture.tiny, keep) if moved else IDENTITY
            aligned = align(template, cur_picture.coarse, start, keep, rules)
            agreement = agreement_of(aligned.error, tolerated)
            share = float(agreement @ counted)
            if share > best_share:
                best, best_share = aligned.cur_from_prev, share
            if share >= _SURE:
                break
            around = cv2.dilate(agreement.reshape(shape), _NEIGHBOURS).ravel()
            keep, moved = keep * (around < _DISAGREES), True
            if keep.mean() < _ENOUGH_LEFT:
                break
        return best

    def _voted(self, prev: Image, cur: Image, keep: Floats) -> Transform:
        start = np.eye(3)
        shift_xy = voted_shift(prev, cur, keep.reshape(self.grid.shape))
        start[:2, 2] = np.divide(shift_xy, self._scales.tiny_per_unit)
        return start


_ALONG: Final = 4  # blocks along the longer side
_ACROSS: Final = 3  # and along the shorter
_REACH: Final = 0.25  # of the longer side
_LEAST: Final = 0.5  # of the background that the freest block has


def voted_shift(prev: Image, cur: Image, background: Floats) -> tuple[float, float]:
    """Shift (dx, dy) in pixels of two small pictures (H, W) uint8.

    Each block of the previous picture is sought all around its place, and the maps of normalised
    correlation are added up: no jump is too large, and a block counts by its area, however
    strong its texture. `background` (rows, columns) 0..1 tells what of the picture may vote.
    """
    height, width = prev.shape
    reach = round(_REACH * max(height, width))
    around = cv2.copyMakeBorder(cur, reach, reach, reach, reach, cv2.BORDER_REFLECT_101)
    columns, rows = (_ALONG, _ACROSS) if width >= height else (_ACROSS, _ALONG)
    free = cv2.resize(background, (columns, rows), interpolation=cv2.INTER_AREA)
    if not free.any():
        return 0.0, 0.0
    block_h, block_w = height // rows, width // columns
    likenesses = []
    for row, column in np.argwhere(free >= _LEAST * free.max()).tolist():
        top, left = row * block_h, column * block_w
        block = prev[top : top + block_h, left : left + block_w]
        place = around[top : top + block_h + 2 * reach, left : left + block_w + 2 * reach]
        likenesses.append(cv2.matchTemplate(place, block, cv2.TM_CCOEFF_NORMED))
    votes = np.add.reduce(np.square(np.maximum(likenesses, 0)))
    _, _, _, (x, y) = cv2.minMaxLoc(cv2.GaussianBlur(votes, (3, 3), 0))
    return float(x - reach), float(y - reach)
