"""The crops of the reference trackers, which differ in the rounding of corners and colors.

All of them call `FrameView.crop_square`, so they work on stabilized views as well. It computes the
corner from a center in half pixels, which can express any whole-pixel corner exactly. On a raw view
each crop equals that of its reference to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.stabilize import FrameView
from ssiam.trackers.siamese import Floats

Crop: TypeAlias = Callable[[FrameView, tuple[float, float], int, int, Floats], Image]


def pysot_crop(
    view: FrameView, center_xy: tuple[float, float], side: int, out: int, fill: Floats
) -> Image:
    """Crop of STVIR/pysot, with corners rounded half up: the same as `FrameView.crop_square`.

    Parameters
    ----------
    view : FrameView
    center_xy : (x, y)
        Stabilized pixels.
    side, out : int
        Side of the square in stabilized pixels, and side of the result.
    fill : (3,) float64
        Color (BGR) outside of the frame; fractions are truncated.

    Returns
    -------
    (out, out, 3) uint8 BGR
    """
    return view.crop_square(center_xy, side, out, fill)


def siammask_crop(
    view: FrameView, center_xy: tuple[float, float], side: int, out: int, fill: Floats
) -> Image:
    """Crop of foolwood/SiamMask: as `pysot_crop`, but with corners rounded half to even."""
    left, top = (round(c - (side + 1) / 2) for c in center_xy)
    return view.crop_square(_center(left, top, side), side, out, fill)


def siamfc_crop(
    view: FrameView, center_xy: NDArray[np.float32], side: float, out: int, fill: Floats
) -> Image:
    """Crop of huanglianghua/siamfc-pytorch, in RGB: side, corners and color rounded half to even.

    The parameters are those of `pysot_crop`, but `side` may be fractional, `fill` is RGB, and the
    center (2,) has single precision, on which some roundings depend. The result is
    (out, out, 3) uint8 **RGB**.
    """
    whole = round(side)
    left, top = (int(np.rint(c)) for c in center_xy - np.float32((whole - 1) / 2))
    crop = view.crop_square(_center(left, top, whole), whole, out, np.rint(fill[::-1]))
    return np.asarray(cv2.cvtColor(crop, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def _center(left: int, top: int, side: int) -> tuple[float, float]:
    """The center from which `FrameView.crop_square` takes the corner (left, top)."""
    return left + (side + 1) / 2, top + (side + 1) / 2
