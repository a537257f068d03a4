"""The coarse estimate of the camera motion, from which the fine alignment starts."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import IDENTITY, Image, Transform
from ssiam.motion import kernel
from ssiam.motion.alignment import AlignmentSettings, agreement, align
from ssiam.motion.cells import AnyTemplate, Floats, Grid
from ssiam.motion.pyramid import Pyramid, PyramidBuilder

# Without an excluded box, all cells get equal weight and a tolerance that shrinks.
_WITH_EXCLUSION: Final = AlignmentSettings(
    noise=1.0, tolerance=0.3, evenness=0.5, max_iterations=8, min_step=2e-3
)
_WITHOUT_EXCLUSION: Final = replace(
    _WITH_EXCLUSION, evenness=1.0, max_iterations=16, min_step=1e-3, tightening=0.8
)
_AGAIN: Final = replace(_WITHOUT_EXCLUSION, max_iterations=32)

_MIN_AGREEING: Final = 0.5  # share of the textured cells; below it, another start is tried
_DISAGREEING: Final = 0.3  # agreement below which a cell may be on an independent object
_MIN_REMAINING: Final = 0.15  # share of the cells that must remain for another start
_NEIGHBORS: Final = np.ones((3, 3), np.uint8)
_EPSILON: Final = 1e-3

# Block matching
_LONG_BLOCKS: Final = 4  # blocks along the longer side
_SHORT_BLOCKS: Final = 3  # blocks along the shorter side
_REACH: Final = 0.25  # search range in each direction, share of the longer side
_MIN_BACKGROUND: Final = 0.5  # relative to the largest background share of a block


class CoarseEstimator:
    """Estimates rigid motion at 80 pixels, for frames of one size; block matching finds jumps."""

    def __init__(self, builder: PyramidBuilder) -> None:
        self._builder = builder
        self.grid = Grid(
            builder.coarse_wh, builder.coarse_from_unit, stride=1, side=5, model="rigid"
        )

    def estimate(
        self,
        prev: tuple[Pyramid, AnyTemplate],
        cur: tuple[Pyramid, AnyTemplate],
        boxes: NDArray[np.float64],
        not_overlay: Floats,
        scene: Floats | None = None,
        *,
        again: bool = False,
    ) -> Transform:
        """cur_from_prev in units.

        If most cells disagree with the first result, it may be the motion of the largest moving
        object: a second estimate is started from the disagreeing cells, and the motion that more
        cells agree with is returned.

        Parameters
        ----------
        prev, cur : (Pyramid, template)
            Pyramid and coarse template of the previous and the current frame.
        boxes : (N, 4) float64
            Excluded boxes: low x, low y, high x, high y in units.
        not_overlay : (rows, columns) float32
            0 where an overlay is drawn on the frame, else 1; a grid of any resolution.
        scene : (cells,) float32, optional
            0 for cells outside the scene, else 1.
        again : bool
            Whether an earlier estimate was wrong. Then cells are weighted as without boxes, which
            is better for strong shake and worse where few cells have texture, and there are more
            iterations, for strong roll.
        """
        (prev_pyramid, template), (cur_pyramid, cur_template) = prev, cur
        first = _WITH_EXCLUSION if len(boxes) else _WITHOUT_EXCLUSION
        settings = _AGAIN if again else first
        shape = self.grid.shape
        visible = cv2.resize(not_overlay, shape[::-1], interpolation=cv2.INTER_AREA)
        background_share = self.grid.background_share(boxes) * visible.ravel()
        if scene is not None:
            background_share *= scene
        weight = background_share * template.textured
        weight /= max(float(weight.sum()), _EPSILON)
        tolerated = settings.tolerated(template.texture)
        unmoved = agreement(template.change_to(cur_template), tolerated)
        moved = bool(unmoved @ weight < _MIN_AGREEING)
        best, best_share = IDENTITY, -1.0
        for _ in range(2):
            start = (
                self._block_start(prev_pyramid.tiny, cur_pyramid.tiny, background_share)
                if moved
                else IDENTITY
            )
            aligned = align(template, cur_pyramid.coarse, start, background_share, settings)
            agreeing = agreement(aligned.error, tolerated)
            share = float(agreeing @ weight)
            if share > best_share:
                best, best_share = aligned.cur_from_prev, share
            if share >= _MIN_AGREEING:
                break
            max_nearby = cv2.dilate(agreeing.reshape(shape), _NEIGHBORS).ravel()
            background_share, moved = background_share * (max_nearby < _DISAGREEING), True
            if background_share.mean() < _MIN_REMAINING:
                break
        return best

    def _block_start(self, prev: Image, cur: Image, background_share: Floats) -> Transform:
        """The shift between two tiny images, as a transform of units."""
        start = np.eye(3)
        shift_xy = _block_shift(prev, cur, background_share.reshape(self.grid.shape))
        start[:2, 2] = np.divide(shift_xy, self._builder.tiny_per_unit)
        return start


def _block_shift(prev: Image, cur: Image, background: Floats) -> tuple[float, float]:
    """Shift (dx, dy) in pixels between two small images (H, W) uint8, by block matching.

    Each block of the previous image is searched for around its position, and the squared maps of
    normalized correlation are summed. This finds large jumps, and gives all blocks the same
    weight, however strong their texture. `background` (rows, columns) is the background share 0..1
    of the cells; blocks with little background are not used.
    """
    height, width = prev.shape
    reach = round(_REACH * max(height, width))
    columns, rows = (
        (_LONG_BLOCKS, _SHORT_BLOCKS) if width >= height else (_SHORT_BLOCKS, _LONG_BLOCKS)
    )
    share: Floats = np.asarray(
        cv2.resize(background, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.float32
    )
    if not share.any():
        return 0.0, 0.0
    min_share = _MIN_BACKGROUND * float(share.max())
    if kernel.is_used():
        dx, dy = kernel.block_shift(prev, cur, reach, share, min_share)
        return float(dx), float(dy)
    padded = cv2.copyMakeBorder(cur, reach, reach, reach, reach, cv2.BORDER_REFLECT_101)
    block_h, block_w = height // rows, width // columns
    correlations = []
    for row, column in np.argwhere(share >= min_share).tolist():
        top, left = row * block_h, column * block_w
        block = prev[top : top + block_h, left : left + block_w]
        region = padded[top : top + block_h + 2 * reach, left : left + block_w + 2 * reach]
        correlations.append(cv2.matchTemplate(region, block, cv2.TM_CCOEFF_NORMED))
    total = np.add.reduce(np.square(np.maximum(correlations, 0)))
    _, _, _, (x, y) = cv2.minMaxLoc(cv2.GaussianBlur(total, (3, 3), 0))
    return float(x - reach), float(y - reach)
