"""`Response`: what a tracker finds in a view, before one of the candidates is taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Response:
    """The candidates of one view.

    Attributes
    ----------
    boxes : (4, n) float64
        cx, cy, w, h of the candidates, view pixels.
    score : (n,) float64
        0..1.
    ranked : (n,) float64
        The ranks by which the tracker chooses.
    groups : callable
        Returns for each object in the view, by descending score, which of the candidates (n,) are
        on it.
    details : object
        What the tracker needs to take a candidate.
    """

    boxes: Floats
    score: Floats
    ranked: Floats
    groups: Callable[[], list[NDArray[np.bool_]]]
    details: Any

    @cached_property
    def best(self) -> int:
        """The candidate that the tracker would take."""
        return int(np.argmax(self.ranked))

    @cached_property
    def objects(self) -> list[int]:
        """The best candidate of each object in the view, that of `best` first."""
        groups = (np.flatnonzero(is_on_it) for is_on_it in self.groups())
        indices = [int(group[np.argmax(self.ranked[group])]) for group in groups]
        return list(dict.fromkeys([self.best, *indices]))

    def xywh(self, index: int) -> XYWH:
        """The box of a candidate, view pixels."""
        cx, cy, w, h = self.boxes[:, index].tolist()
        return cx - w / 2, cy - h / 2, w, h
