"""Regions: any textured part of any picture is an object that can be found again.

It needs no labels: two crops of the part, changed as `ssiam.training.augment` changes crops, teach
to compare. Many pictures with few kinds of objects gain by it; its weight should stay low, for a
part has no edge of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image
from ssiam.training.pictures import size_of
from ssiam.training.stills import OnePicture

_TAKEN = 32  # regions of every picture
_CANDIDATES = 8
# Side of a region as a share of the picture's shorter one; standard deviation of its log aspect.
_SIDE = (0.1, 0.45)
_ASPECT = 0.35
# Texture is measured in a picture whose longer side is this.
_SMALL = 320
# Mean square of the brightness's slope in the direction of least slope, grey levels a pixel: below
# it a region could be anywhere along a line, or in the sky.
_LEAST_SLOPE = 16.0

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Region(OnePicture):
    """A track of one frame: the part with the most texture among some at random.

    Attributes
    ----------
    path : Path
        The picture.
    seed : int
        Another seed is another part of it.
    """

    seed: int

    def box(self, t: int) -> XYWH | None:
        """The part; None if there is none with texture."""
        image = self.image(t)
        candidates = _candidates(np.random.default_rng(self.seed), *size_of(image))
        slopes = _least_slopes(image, candidates)
        best = int(np.argmax(slopes))
        x, y, w, h = candidates[best].tolist()
        return (x, y, w, h) if slopes[best] >= _LEAST_SLOPE else None

    def mask(self, t: int) -> None:
        """None: a part has no shape."""
        return


@dataclass(frozen=True, eq=False)
class RegionSource:
    """A `Source` of regions.

    Attributes
    ----------
    name : str
    pictures : tuple of Path
    weight : float
    alike : bool
        Whether two pictures may show the same things.
    """

    name: str
    pictures: tuple[Path, ...]
    weight: float = 1.0
    alike: bool = False

    def __len__(self) -> int:
        """Number of regions."""
        return _TAKEN * len(self.pictures)

    def track(self, i: int) -> Region:
        """The region of an index."""
        return Region(self.pictures[i % len(self.pictures)], i)

    def beside(self, i: int) -> Sequence[int]:
        """None: parts of one picture may overlap."""
        return ()


def _candidates(rng: np.random.Generator, width: int, height: int) -> Floats:
    """Boxes (N, 4) inside of the picture."""
    low, high = np.log(_SIDE)
    side = min(width, height) * np.exp(rng.uniform(low, high, _CANDIDATES))
    stretch = np.exp(_ASPECT / 2 * rng.normal(size=_CANDIDATES))
    w, h = np.minimum(side * stretch, width), np.minimum(side / stretch, height)
    x, y = rng.random((2, _CANDIDATES)) * (width - w, height - h)
    return np.stack([x, y, w, h], axis=1)


def _least_slopes(image: Image, xywh: Floats) -> Floats:
    """The smaller eigenvalue (N,) of the mean structure tensor in every box."""
    shrink = min(1.0, _SMALL / max(size_of(image)))
    small = cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    grey = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)
    across = cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=1 / 8)
    down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=1 / 8)
    products = np.stack([across * across, down * down, across * down], axis=2)
    sums = cv2.integral(products, sdepth=cv2.CV_64F)
    left, top = (xywh[:, :2] * shrink).astype(int).T
    right = np.minimum(left + np.maximum((xywh[:, 2] * shrink).astype(int), 1), grey.shape[1])
    bottom = np.minimum(top + np.maximum((xywh[:, 3] * shrink).astype(int), 1), grey.shape[0])
    total = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    xx, yy, xy = total.T / np.maximum((right - left) * (bottom - top), 1)
    return np.asarray((xx + yy) / 2 - np.hypot((xx - yy) / 2, xy))
