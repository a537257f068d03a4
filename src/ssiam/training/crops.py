"""`Window`: the part of a picture that a crop shows, and the way of boxes and masks into it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image, Transform, map_points
from ssiam.trackers.siamese import TEMPLATE_SIDE, TargetState
from ssiam.training.batches import MASK, MASK_STRIDE, SEARCH
from ssiam.training.sources import Mask


@dataclass(frozen=True)
class Window:
    """A square of a picture, perhaps turned and stretched a little.

    Attributes
    ----------
    center_xy : (float, float)
        What is seen in the middle of the crop; pixels of the picture, counted at their centres.
    side : float
        Side of the square, pixels of the picture.
    out : int
        Side of the crop, pixels.
    stretch : float
        Factor by which the width seen is larger, and the height smaller.
    angle : float
        By which the crop's content is turned, radians.
    mirrored : bool
        Whether left and right are exchanged.
    """

    center_xy: tuple[float, float]
    side: float
    out: int
    stretch: float = 1.0
    angle: float = 0.0
    mirrored: bool = False

    @property
    def zooms(self) -> tuple[float, float]:
        """Pixels of the crop for a pixel of the picture, across and down."""
        zoom = self.out / self.side
        return zoom / self.stretch, zoom * self.stretch

    @property
    def crop_from_frame(self) -> Transform:
        """(3, 3) float64, pixels of the picture to those of the crop."""
        across, down = self.zooms
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        linear = np.diag((-across if self.mirrored else across, down))
        linear = linear @ np.array([[cos, -sin], [sin, cos]])
        matrix = np.eye(3)
        matrix[:2, :2] = linear
        matrix[:2, 2] = (self.out - 1) / 2 - linear @ self.center_xy
        return matrix

    def seen(self, xywh: XYWH) -> NDArray[np.float64]:
        """Centre x, y from the crop's middle pixel, width, height (4,) of a box of the picture."""
        crop_from_frame = self.crop_from_frame
        across, down = self.zooms
        centre = crop_from_frame[:2, :2] @ np.subtract(centre_of(xywh), self.center_xy)
        return np.array([*centre, xywh[2] * across, xywh[3] * down])

    def seen_of(self, mask: Mask) -> NDArray[np.float64]:
        """The same (4,) of the box around a mask (H, W) that is not empty, however it is turned."""
        hull = cv2.convexHull(cv2.findNonZero(mask.astype(np.uint8)))[:, 0]
        places = (hull - np.array(self.center_xy)) @ self.crop_from_frame[:2, :2].T
        low, high = places.min(axis=0), places.max(axis=0)
        return np.concatenate([(low + high) / 2, high - low + self.zooms])

    def is_within(self, size_wh: tuple[int, int]) -> bool:
        """Whether a picture of (width, height) pixels fills the crop."""
        edge = self.out - 1
        corners = [(0, 0), (edge, 0), (edge, edge), (0, edge)]
        frame_from_crop = np.asarray(np.linalg.inv(self.crop_from_frame), dtype=np.float64)
        places = map_points(frame_from_crop, corners)
        return bool((places >= 0).all() and (places <= np.subtract(size_wh, 1)).all())

    def hides(self, xywh: XYWH, margin: float = 0.0) -> bool:
        """Whether nothing of a box is in the crop, nor within `margin` pixels of the crop."""
        cx, cy, w, h = self.seen(xywh)
        reach = self.out / 2 + margin
        return bool(abs(cx) - w / 2 >= reach or abs(cy) - h / 2 >= reach)


def centre_of(xywh: XYWH) -> tuple[float, float]:
    """The middle of a box's pixels, (w - 1) / 2 from the first one."""
    return TargetState.from_xywh(xywh).center_xy


def window_around(xywh: XYWH, out: int) -> Window:
    """The square around a target that shows it in a crop of `out` pixels at the usual zoom.

    127 pixels are the target with half of its width and height around it, sqrt((w + c) (h + c))
    with c = (w + h) / 2; a larger crop has the same zoom.
    """
    state = TargetState.from_xywh(xywh)
    return Window(state.center_xy, state.context_side * out / TEMPLATE_SIDE, out)


def crop_picture(image: Image, window: Window, behind: Image | None = None) -> Image:
    """The crop (out, out, 3) uint8.

    Outside of the picture is its mean colour, or what lies `behind`: (out, out, 3) uint8.
    """
    if behind is None:
        return _warped(image, window, cv2.mean(image)[:3])
    crop = cv2.warpAffine(
        image,
        window.crop_from_frame[:2],
        (window.out, window.out),
        dst=behind.copy(),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_TRANSPARENT,
    )
    return np.asarray(crop, dtype=np.uint8)


def crop_mask(mask: Mask, window: Window) -> NDArray[np.uint8]:
    """How much of every pixel (out, out) uint8 of the crop a mask covers, 0..255."""
    return _warped(mask.astype(np.uint8) * 255, window, (0.0,))


def mask_cells(coverage: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Coverage (64, 64) uint8, 0..255, of cells of 4x4 pixels, of a search crop's `crop_mask`."""
    beyond = MASK * MASK_STRIDE - SEARCH
    whole = cv2.copyMakeBorder(coverage, 0, beyond, 0, beyond, cv2.BORDER_REPLICATE)
    cells = cv2.resize(whole, (MASK, MASK), interpolation=cv2.INTER_AREA)
    return np.asarray(cells, dtype=np.uint8)


def _warped(image: NDArray[np.uint8], window: Window, fill: Sequence[float]) -> NDArray[np.uint8]:
    crop = cv2.warpAffine(
        image,
        window.crop_from_frame[:2],
        (window.out, window.out),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=fill,
    )
    return np.asarray(crop, dtype=np.uint8)
