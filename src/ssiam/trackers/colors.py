"""Histograms of the colors in a box, without their brightness.

Color separates objects that have the same form for a network: cars, clothes, animals. In a gray
video all histograms are equal.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH
from ssiam.stabilize import FrameView

Floats = NDArray[np.float64]

_SIDE: Final = 40  # px, side of the crop that is counted
_CENTER: Final = 0.84  # share of the box's sides; the rest is mostly background
_BINS: Final = 14  # along each of the two axes of color
_RANGE: Final = (78, 178)  # of a* and b* in 8 bits, stronger colors are clipped; 128 is gray
_SPREAD: Final = 1.0  # bins, sd of the smoothing


def color_histogram(view: FrameView, xywh: XYWH) -> Floats:
    """Square roots of the shares of the colors in `xywh`, view pixels, as a unit vector."""
    x, y, w, h = xywh
    margin_x, margin_y = (1 - _CENTER) / 2 * w, (1 - _CENTER) / 2 * h
    center = x + margin_x, y + margin_y, _CENTER * w, _CENTER * h
    lab = cv2.cvtColor(view.crop(center, (_SIDE, _SIDE)).image, cv2.COLOR_BGR2LAB)
    lab = np.clip(lab, _RANGE[0], _RANGE[1] - 1)
    counts = cv2.calcHist([lab], [1, 2], None, [_BINS, _BINS], [*_RANGE, *_RANGE])
    smooth = cv2.GaussianBlur(counts, (0, 0), _SPREAD).ravel().astype(np.float64)
    return np.asarray(np.sqrt(smooth / smooth.sum()))


def color_similarity(one: Floats, other: Floats) -> float:
    """Bhattacharyya coefficient of two histograms, 0..1."""
    return float(one @ other)
