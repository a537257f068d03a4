"""`FrameView`: a stabilized view of a raw frame, from which trackers take their search regions.

The paper warps the whole frame and then crops a small square out of it. Both are affine, so the
two are one `warpAffine` of the square's size, directly from the raw frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import IDENTITY, XYWH, Image, Transform, png_bytes

Color = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FrameView:
    """A stabilized frame; only the requested part is computed.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    raw : (H, W, 3) uint8 BGR
    stab_from_raw : (3, 3) float64
        Maps raw-frame pixels to stabilized pixels (M_t of eq. 7).
    border : int
        N of eq. 6: pixels that `render` adds on each side. Stabilized coordinates do not include
        them: stabilized (0, 0) is pixel (N, N) of `render`.
    """

    raw: Image
    stab_from_raw: Transform = field(default_factory=lambda: IDENTITY)
    border: int = 0

    def __repr__(self) -> str:
        width, height = self.size_wh
        return f"FrameView({width}x{height}, border={self.border}, is_raw={self.is_raw})"

    def _repr_png_(self) -> bytes:
        """The stabilized frame, as notebooks show it."""
        return png_bytes(self.render())

    @property
    def size_wh(self) -> tuple[int, int]:
        """Width and height of the raw frame, pixels."""
        return self.raw.shape[1], self.raw.shape[0]

    @cached_property
    def raw_from_stab(self) -> Transform:
        """Maps stabilized pixels to raw-frame pixels: the inverse transform (eq. 9)."""
        return np.asarray(np.linalg.inv(self.stab_from_raw))

    @cached_property
    def is_raw(self) -> bool:
        """Whether this view is the raw frame."""
        return bool(np.array_equal(self.stab_from_raw, IDENTITY))

    def crop(self, center_xy: tuple[float, float], side: int, out: int, fill: Color) -> Image:
        """Crop a square of the stabilized frame, resized to (out, out, 3) uint8 BGR.

        On a raw view this is the reference trackers' crop (pysot's `get_subwindow`) bit for bit,
        including its rounding of the corner; on a stabilized view it is the same square.

        Parameters
        ----------
        center_xy : (float, float)
            Center of the square, stabilized pixels.
        side : int
            Side of the square, stabilized pixels.
        out : int
            Side of the result, pixels.
        fill : (3,) float64
            Color outside of the frame, BGR; its fractions are truncated.
        """
        # The reference trackers round the corner center - (side + 1) / 2 half up.
        left, top = (int(np.floor(c - (side + 1) / 2 + 0.5)) for c in center_xy)
        if self.is_raw:
            return _subwindow(self.raw, left, top, side, out, _color(fill))
        return self.crop_rectangle((left, top, side, side), (out, out), fill)

    def crop_rectangle(self, xywh: XYWH, out_wh: tuple[int, int], fill: Color) -> Image:
        """Crop a rectangle of the stabilized frame, stretched to `out_wh`: (H, W, 3) uint8 BGR.

        The rectangle is not rounded to whole pixels.

        Parameters
        ----------
        xywh : (x, y, w, h)
            Stabilized pixels; (0, 0) is the top left corner of the first pixel.
        out_wh : (int, int)
            Width and height of the result, pixels.
        fill : (3,) float64
            Color outside of the frame, BGR; its fractions are truncated.
        """
        x, y, w, h = xywh
        across, down = w / out_wh[0], h / out_wh[1]
        stab_from_crop = np.array(
            [[across, 0, x + across / 2 - 0.5], [0, down, y + down / 2 - 0.5], [0, 0, 1]]
        )
        return _warp(self.raw, self.raw_from_stab @ stab_from_crop, out_wh, _color(fill))

    def render(self, part: XYWH | None = None) -> Image:
        """Render the stabilized frame with its border: (H + 2N, W + 2N, 3) uint8, black outside.

        A raw view without a border is the raw frame, not a copy of it.

        Parameters
        ----------
        part : (x, y, w, h), optional
            Render only this part of a stabilized frame, stabilized pixels; the rest is black. A
            raw view is always rendered whole.
        """
        n = self.border
        if self.is_raw and n == 0:
            return self.raw
        if self.is_raw:
            bordered = cv2.copyMakeBorder(self.raw, n, n, n, n, cv2.BORDER_CONSTANT)
            return np.asarray(bordered, dtype=np.uint8)
        width, height = self.size_wh
        size_wh = width + 2 * n, height + 2 * n
        left, top, right, bottom = _part_limits(part, n, size_wh)
        rendered = np.zeros((size_wh[1], size_wh[0], 3), np.uint8)
        if left < right and top < bottom:
            stab_from_part = np.array([[1.0, 0, left - n], [0, 1, top - n], [0, 0, 1]])
            raw_from_part = self.raw_from_stab @ stab_from_part
            warped = _warp(self.raw, raw_from_part, (right - left, bottom - top), [0, 0, 0])
            rendered[top:bottom, left:right] = warped
        return rendered


def _color(fill: Color) -> list[float]:
    """The fill color for OpenCV, without its fractions."""
    color: list[float] = np.trunc(fill).tolist()
    return color


def _part_limits(
    part: XYWH | None, border: int, size_wh: tuple[int, int]
) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of the rendered pixels that contain a box of stabilized pixels."""
    if part is None:
        return 0, 0, *size_wh
    x, y, w, h = part
    low, high = np.floor([x, y]) + border, np.ceil([x + w, y + h]) + border
    left, top = np.clip(low, 0, size_wh).astype(int).tolist()
    right, bottom = np.clip(high, 0, size_wh).astype(int).tolist()
    return left, top, right, bottom


def _warp(
    raw: Image, raw_from_out: Transform, size_wh: tuple[int, int], color: list[float]
) -> Image:
    """Warp to (width, height) pixels: pixel p is the raw frame at ``raw_from_out @ p``."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped = cv2.warpAffine(
        raw,
        raw_from_out[:2],
        size_wh,
        flags=flags,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=color,
    )
    return np.asarray(warped, dtype=np.uint8)


def _subwindow(raw: Image, left: int, top: int, side: int, out: int, color: list[float]) -> Image:
    """Square [left, left + side) x [top, top + side) of the raw frame, resized to (out, out)."""
    height, width = raw.shape[:2]
    right, bottom = left + side, top + side
    inside = raw[
        min(max(top, 0), height) : max(min(bottom, height), 0),
        min(max(left, 0), width) : max(min(right, width), 0),
    ]
    if inside.size == 0:
        inside = np.full((side, side, 3), color, dtype=np.uint8)
    elif inside.shape[:2] != (side, side):
        y, x = max(-top, 0), max(-left, 0)
        below, right_of = side - y - inside.shape[0], side - x - inside.shape[1]
        padded = cv2.copyMakeBorder(inside, y, below, x, right_of, cv2.BORDER_CONSTANT, value=color)
        inside = np.asarray(padded, dtype=np.uint8)
    if side == out:
        return np.ascontiguousarray(inside)
    return np.asarray(cv2.resize(inside, (out, out)), dtype=np.uint8)
