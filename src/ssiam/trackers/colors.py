"""Histograms of the colors in a box, without their brightness.

Color separates objects that have the same form for a network: cars, clothes, animals. In a gray
video all histograms are equal.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image
from ssiam.stabilize import FrameView

Floats = NDArray[np.float64]

_SIDE: Final = 40  # px, side of the crop that is counted
_CENTER: Final = 0.84  # share of the box's sides; the rest is mostly background
_BINS: Final = 14  # along each of the two axes of color
_RANGE: Final = (78, 178)  # of a* and b* in 8 bits, stronger colors are clipped; 128 is gray
_SPREAD: Final = 1.0  # bins, sd of the smoothing

# CIE 1976 L*a*b* of sRGB colors. OpenCV's own conversion fills its tables at its first call, which
# would take a tenth of a second amid a video.
_GRAY_LEVELS: Final = np.arange(256) / 255
_LINEAR: Final = np.where(
    _GRAY_LEVELS <= 0.04045, _GRAY_LEVELS / 12.92, ((_GRAY_LEVELS + 0.055) / 1.055) ** 2.4
)  # IEC 61966-2-1
_XYZ_FROM_BGR: Final = np.array(
    [
        [0.180423, 0.357580, 0.412453],
        [0.072169, 0.715160, 0.212671],
        [0.950227, 0.119193, 0.019334],
    ]
)  # ITU-R BT.709, white D65
_SHARES_FROM_BGR: Final = _XYZ_FROM_BGR / _XYZ_FROM_BGR.sum(axis=1, keepdims=True)  # of white
_DARK: Final = (6 / 29) ** 3  # below it the cube root is replaced by its tangent


def color_histogram(view: FrameView, xywh: XYWH) -> Floats:
    """Square roots of the shares of the colors in `xywh`, view pixels, as a unit vector."""
    x, y, w, h = xywh
    margin_x, margin_y = (1 - _CENTER) / 2 * w, (1 - _CENTER) / 2 * h
    center = x + margin_x, y + margin_y, _CENTER * w, _CENTER * h
    colors = _a_b(view.crop(center, (_SIDE, _SIDE)).image)
    colors = np.clip(colors, _RANGE[0], _RANGE[1] - 1)
    counts = cv2.calcHist([colors], [0, 1], None, [_BINS, _BINS], [*_RANGE, *_RANGE])
    smooth = cv2.GaussianBlur(counts, (0, 0), _SPREAD).ravel().astype(np.float64)
    return np.asarray(np.sqrt(smooth / smooth.sum()))


def color_similarity(one: Floats, other: Floats) -> float:
    """Bhattacharyya coefficient of two histograms, 0..1."""
    return float(one @ other)


def _a_b(image: Image) -> Image:
    """a* and b* of the pixels, each plus 128: (H, W, 2) uint8."""
    shares = _LINEAR[image] @ _SHARES_FROM_BGR.T
    roots = np.where(shares > _DARK, np.cbrt(shares), shares * (29 / 6) ** 2 / 3 + 4 / 29)
    x, y, z = np.moveaxis(roots, -1, 0)
    a_b = np.stack([500 * (x - y), 200 * (y - z)], axis=-1)
    return np.asarray(np.rint(a_b + 128), np.uint8)
