"""`Batch`: what one step of training looks at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image

TEMPLATE: Final = 127  # pixels, side of the template crop
SEARCH: Final = 255  # pixels, side of the search crop
MASK_STRIDE: Final = 4
MASK: Final = 64  # cells, side of the mask: the last row and column reach one pixel too far

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]


class Pair(NamedTuple):
    """A template and a search crop.

    Attributes
    ----------
    template, search : (127, 127, 3), (255, 255, 3) uint8 BGR
    box : (4,) float32
        Centre x, y from the middle pixel of the search crop, width, height of the target; its
        pixels. Zeros where it is not there.
    present : bool
        Whether the target is in the search crop.
    mask : (64, 64) uint8, optional
        How much of each cell of 4x4 pixels the target covers, 0..255; None: not told.
    recent : (127, 127, 3) uint8 BGR, optional
        The target as a tracker has seen it lately; None: as in the template.
    template_wh : (float, float)
        Size of the target in the template crop, pixels.
    """

    template: Image
    search: Image
    box: Floats
    present: bool
    mask: Bytes | None
    recent: Image | None = None
    template_wh: tuple[float, float] = (0.0, 0.0)


class Lessons(NamedTuple):
    """What a trained network says of N pairs, on the 15 x 15 cells of `ssiam.networks.lite2`.

    Attributes
    ----------
    score : (N, 15, 15) float32
        Probability that the cell is on the target.
    boxes : (N, 4, 15, 15) float32
        Left, top, right, bottom, px from the search crop's middle pixel.
    weight : (N,) float32
        0 where nothing is to be learned from it.
    """

    score: Floats
    boxes: Floats
    weight: Floats


@dataclass
class Batch:
    """N pairs of crops with what is to be found in them.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    template : (N, 3, 127, 127) uint8 BGR
    search : (N, 3, 255, 255) uint8 BGR
    box : (N, 4) float32
        cx, cy, w, h of the target in pixels of the search crop, from its middle pixel
        (127, 127); zeros where it is not present.
    present : (N,) bool
    mask : (N, 64, 64) uint8
        Covered share of cells, 0..255; cell (i, j) is pixels 4 i..4 i + 3 and 4 j..4 j + 3.
    masked : (N,) bool
        Whether the mask is told; a target that is not present has an empty one.
    weight : (N,) float32
    recent : (N, 3, 127, 127) uint8 BGR, optional
    template_wh : (N, 2) float32, optional
        Size of the target in the template crop, pixels.
    lessons : Lessons, optional
    """

    template: Bytes
    search: Bytes
    box: Floats
    present: Flags
    mask: Bytes
    masked: Flags
    weight: Floats
    recent: Bytes | None = None
    template_wh: Floats | None = None
    lessons: Lessons | None = None

    def __len__(self) -> int:
        """Number of pairs."""
        return len(self.template)


def batch_of(pairs: Sequence[Pair]) -> Batch:
    """The pairs as one batch, each of weight 1."""
    empty = np.zeros((MASK, MASK), dtype=np.uint8)
    return Batch(
        template=_planes([pair.template for pair in pairs]),
        search=_planes([pair.search for pair in pairs]),
        box=np.stack([pair.box for pair in pairs]),
        present=np.array([pair.present for pair in pairs]),
        mask=np.stack([empty if pair.mask is None else pair.mask for pair in pairs]),
        masked=np.array([pair.mask is not None for pair in pairs]),
        weight=np.ones(len(pairs), dtype=np.float32),
        recent=_recent(pairs),
        template_wh=np.array([pair.template_wh for pair in pairs], dtype=np.float32),
    )


def _planes(images: Sequence[Image]) -> Bytes:
    return np.ascontiguousarray(np.stack(images).transpose(0, 3, 1, 2))


def _recent(pairs: Sequence[Pair]) -> Bytes | None:
    if all(pair.recent is None for pair in pairs):
        return None
    return _planes([pair.template if pair.recent is None else pair.recent for pair in pairs])
