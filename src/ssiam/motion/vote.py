"""Where to begin: the shift that most blocks of the picture agree on."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from ssiam.geometry import Image
from ssiam.motion.cells import Floats

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
