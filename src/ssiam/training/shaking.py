"""Shake augmentation: the jump and the blur that a shaking camera makes of one frame.

The paths are those of `ssiam.datasets.shake.path`, by which trackers are tested too: hand-held,
vibrating, in gusts, white. Between two frames the path moves the target in the picture, and while
the shutter is open it smears it along the path.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import ShakeKind
from ssiam.datasets.shake.path import sample_path
from ssiam.geometry import Image, Transform

# How often each is drawn.
_KINDS: Final[tuple[tuple[ShakeKind, float], ...]] = (
    ("handheld", 0.4),
    ("vibration", 0.25),
    ("gusts", 0.15),
    ("white", 0.2),
)
_STRENGTHS: Final = (0.004, 0.03)  # shares of the picture's width
_EXPOSURES: Final = (0.1, 0.9)  # shares of the frame interval
_INSTANTS: Final = 24
# Pixels of the crop: a longer smear leaves nothing of a target; a shorter one is none.
_LONGEST: Final = 20.0
_SHORTEST: Final = 0.7

Floats = NDArray[np.float64]


class Shake(NamedTuple):
    """What a shake does to a point of the picture in one frame.

    Attributes
    ----------
    step_xy : (2,) float64
        How far the point has moved since the frame before, pixels of the picture.
    trail : (N, 2) float64
        Its way while the shutter is open, from the mean of it; pixels of the picture.
    """

    step_xy: Floats
    trail: Floats


STILL: Final = Shake(np.zeros(2), np.zeros((1, 2)))


def draw_shake(
    point_xy: tuple[float, float], size_wh: tuple[int, int], rng: np.random.Generator
) -> Shake:
    """A random shake, at a point of a picture of (width, height) pixels."""
    kinds, chances = zip(*_KINDS, strict=True)
    kind: ShakeKind = kinds[rng.choice(len(kinds), p=chances)]
    strength = float(np.exp(rng.uniform(*np.log(_STRENGTHS))))
    exposure = rng.uniform(*_EXPOSURES)
    path = sample_path(kind, strength, int(rng.integers(1 << 31)), 2, size_wh, "")
    open_for = exposure * ((np.arange(_INSTANTS) + 0.5) / _INSTANTS - 0.5)
    places = path.at(open_for + np.array([[0.0], [1.0]])) @ np.array([*point_xy, 1.0])
    before, now = places[..., :2]
    return Shake(now.mean(axis=0) - before.mean(axis=0), now - now.mean(axis=0))


def smeared(crop: Image, trail: Floats, crop_from_frame: Transform) -> Image:
    """The crop blurred along a trail (N, 2) in pixels of the picture; its middle stays."""
    ways = trail @ crop_from_frame[:2, :2].T
    longest = float(np.abs(ways).max())
    if longest < _SHORTEST:
        return crop
    kernel = _kernel(ways * min(1.0, _LONGEST / longest))
    return np.asarray(
        cv2.filter2D(crop, -1, kernel, borderType=cv2.BORDER_REPLICATE), dtype=np.uint8
    )


def _kernel(ways: Floats) -> NDArray[np.float32]:
    """Share of the time that the picture lies at every offset (2 r + 1, 2 r + 1)."""
    radius = int(np.ceil(np.abs(ways).max())) + 1
    # `filter2D` looks up where a pixel's light comes from: against the way.
    places = radius - ways
    low = np.floor(places).astype(int)
    right, below = (places - low).T
    kernel = np.zeros((2 * radius + 1, 2 * radius + 1), dtype=np.float32)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        share = np.abs(1 - dx - right) * np.abs(1 - dy - below)
        np.add.at(kernel, (low[:, 1] + dy, low[:, 0] + dx), share)
    return np.asarray(kernel / kernel.sum())
