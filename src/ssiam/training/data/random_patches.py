"""Random patches: any textured part of an image is a target that can be found again.

Random patches need no labels. Their weight should stay low, since a patch has no object boundary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image
from ssiam.training.data.images import image_size
from ssiam.training.data.tracks import SingleImageTrack

__all__ = ["RandomPatchSource", "RandomPatchTrack"]

_PER_IMAGE: Final = 32  # patches
_CANDIDATES: Final = 8  # drawn for each patch; the one with the most texture is used
_SIDE: Final = (0.1, 0.45)  # of a patch, as a fraction of the image's shorter side
_ASPECT: Final = 0.35  # standard deviation of the log of the aspect ratio
_TEXTURE_SIDE: Final = 320  # px, longer side of the image in which texture is measured
# Smaller eigenvalue of the structure tensor, (gray levels per px)^2. A patch below it cannot be
# localized, for example along a line or in the sky.
_MIN_TEXTURE: Final = 16.0

Floats: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class RandomPatchTrack(SingleImageTrack):
    """A track of one frame: the most textured of several random patches.

    Attributes
    ----------
    path : Path
        The image.
    seed : int
    """

    seed: int

    def box(self, t: int) -> XYWH | None:
        """The patch; None if no candidate has texture."""
        image = self.image(t)
        candidates = _candidates(np.random.default_rng(self.seed), *image_size(image))
        texture = _min_eigenvalues(image, candidates)
        best = int(np.argmax(texture))
        x, y, w, h = candidates[best].tolist()
        return (x, y, w, h) if texture[best] >= _MIN_TEXTURE else None

    def mask(self, t: int) -> None:
        """None: a patch has no shape."""
        return


@dataclass(frozen=True, eq=False)
class RandomPatchSource:
    """A `Source` of random patches.

    Attributes
    ----------
    name : str
    images : tuple of Path
    weight : float
    alike : bool
        Whether two images may show the same objects.
    """

    name: str
    images: tuple[Path, ...]
    weight: float = 1.0
    alike: bool = False

    def __len__(self) -> int:
        """Number of patches."""
        return _PER_IMAGE * len(self.images)

    def track(self, i: int) -> RandomPatchTrack:
        """The patch of an index."""
        return RandomPatchTrack(self.images[i % len(self.images)], i)

    def distractors(self, i: int) -> Sequence[int]:
        """Empty: patches of one image may overlap."""
        return ()


def _candidates(rng: np.random.Generator, width: int, height: int) -> Floats:
    """Boxes (N, 4) inside the image."""
    low, high = np.log(_SIDE)
    side = min(width, height) * np.exp(rng.uniform(low, high, _CANDIDATES))
    stretch = np.exp(_ASPECT / 2 * rng.normal(size=_CANDIDATES))
    w, h = np.minimum(side * stretch, width), np.minimum(side / stretch, height)
    x, y = rng.random((2, _CANDIDATES)) * (width - w, height - h)
    return np.stack([x, y, w, h], axis=1)


def _min_eigenvalues(image: Image, xywh: Floats) -> Floats:
    """The smaller eigenvalue (N,) of the mean structure tensor in each box (N, 4), px."""
    scale = min(1.0, _TEXTURE_SIDE / max(image_size(image)))
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    gray = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)
    across = cv2.Sobel(gray, cv2.CV_32F, 1, 0, scale=1 / 8)
    down = cv2.Sobel(gray, cv2.CV_32F, 0, 1, scale=1 / 8)
    products = np.stack([across * across, down * down, across * down], axis=2)
    sums = cv2.integral(products, sdepth=cv2.CV_64F)
    left, top = (xywh[:, :2] * scale).astype(int).T
    right = np.minimum(left + np.maximum((xywh[:, 2] * scale).astype(int), 1), gray.shape[1])
    bottom = np.minimum(top + np.maximum((xywh[:, 3] * scale).astype(int), 1), gray.shape[0])
    total = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    xx, yy, xy = total.T / np.maximum((right - left) * (bottom - top), 1)
    return np.asarray((xx + yy) / 2 - np.hypot((xx - yy) / 2, xy))
