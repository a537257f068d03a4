"""Clocks, logos and crosshairs: what stands still on the screen while the picture moves."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Transform
from ssiam.motion.cells import Floats, Grid, Template
from ssiam.motion.models import map_units

_MOVED: Final = 1.0  # px of the fine picture that a cell must have moved to tell anything
_SAME: Final = 0.25  # share of the texture by which a cell that stands still may differ
_BETTER: Final = 0.5  # share of the error of moving that standing still must stay below
_CHANGED: Final = 0.5  # share of the texture by which a cell differs that does not stand still
_GAIN: Final = 0.25  # of a frame's evidence
_BELIEVED: Final = 0.5  # three frames in a row


class Overlays:
    """Learns which cells belong to the screen and not to the scene.

    Attributes
    ----------
    background : (cells,) float32
        0 for cells that are drawn over the picture, else 1.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._evidence = np.zeros(grid.cells, dtype=np.float32)
        self.background: Floats = np.ones(grid.cells, dtype=np.float32)

    def update(
        self, prev: Template, cur: Template, cur_from_prev: Transform, error: Floats
    ) -> None:
        """Compare how well moving (`error`, by cell) and standing still explain a frame."""
        still = prev.change_to(cur)
        same = (still < np.minimum(_SAME * prev.texture, _BETTER * error)) & prev.textured
        if same.any():
            evidence = same & self._moved(cur_from_prev)
            self._evidence += np.where(evidence, _GAIN * (1 - self._evidence), 0)
        self._evidence[still > _CHANGED * prev.texture] = 0
        self.background = (self._evidence < _BELIEVED).astype(np.float32)

    def _moved(self, cur_from_prev: Transform) -> NDArray[np.bool_]:
        """Cells (cells,) that moved far enough to tell the screen from the scene."""
        centres = self._grid.centres
        shift = map_units(cur_from_prev, centres) - centres
        return np.asarray(np.hypot(*shift) * self._grid.pixels_per_unit >= _MOVED)
