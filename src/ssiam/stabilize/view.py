"""`FrameView`: a stabilized view of a raw frame, from which trackers take their search regions.

A `Crop` is such a region, as an image or as a network's input, with the way back to the view.

The paper warps the whole frame and then crops a small square out of it. Both are affine, so the
two are one `warpAffine` of the square's size, directly from the raw frame.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import (
    IDENTITY,
    XYWH,
    Image,
    Transform,
    finite_array,
    inverse,
    png_bytes,
    short_repr,
    xywh_floats,
)

Color: TypeAlias = NDArray[np.float64]
PerChannel: TypeAlias = float | Sequence[float] | Color
"""One number for all three channels, or three."""

_IDENTITY_ROWS: Final = IDENTITY.tolist()
# A warp that reads more pixels than these for each one that it makes has three channels.
_MAX_READ: Final = 3
_MAX_FOUR_CHANNELS: Final = 1 << 23  # pixels of a frame: 32 MiB with four channels
_RIM: Final = 2  # px around the part that is read, for interpolation
_MAX_CROP: Final = 4096  # px, sides of a crop: 48 MB


@dataclass(frozen=True, eq=False, repr=False)
class Crop:
    """A rectangle of a view, resized.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    image : (H, W, 3) uint8 BGR
    view_from_crop : (3, 3) float64
        Maps the crop's coordinates to the view's. In both, (0, 0) is the top left corner of the
        first pixel and (0.5, 0.5) its center.
    """

    image: Image
    view_from_crop: Transform

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        x, y, w, h = self.box_in_view((0, 0, width, height))
        return f"Crop({width}x{height} of {x:g},{y:g},{w:g},{h:g})"

    def _repr_png_(self) -> bytes:
        """The crop, as notebooks show it."""
        return png_bytes(self.image)

    def tensor(
        self, *, rgb: bool = False, mean: PerChannel = 0.0, scale: PerChannel = 1.0
    ) -> NDArray[np.float32]:
        """The crop as a network's input: (1, 3, H, W) float32, ``(pixel - mean) * scale``.

        Parameters
        ----------
        rgb : bool
            Whether the channels are red, green, blue; by default blue, green, red.
        mean, scale : float or three floats
            Three are in the order of the result's channels. ImageNet's mean and deviation are
            ``mean=(123.675, 116.28, 103.53), scale=(1 / 58.395, 1 / 57.12, 1 / 57.375)``.

        Raises
        ------
        ArgumentError
            `mean` or `scale` is neither one finite number nor three.
        """
        channels = self.image[..., ::-1] if rgb else self.image
        tensor = np.ascontiguousarray(channels.transpose(2, 0, 1)[None], dtype=np.float32)
        tensor -= _per_channel("mean", mean)
        tensor *= _per_channel("scale", scale)
        return tensor

    def box_in_view(self, xywh: Sequence[float]) -> XYWH:
        """A box (x, y, w, h) of the crop's pixels, in pixels of the view."""
        x, y, w, h = (float(number) for number in xywh)
        (across, _, left), (_, down, top), _ = self.view_from_crop.tolist()
        return left + across * x, top + down * y, across * w, down * h


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
    def mean_color(self) -> Color:
        """The mean color (3,) of the raw frame, BGR."""
        height, width = self.raw.shape[:2]
        total = np.array(cv2.sumElems(self.raw)[:3], dtype=np.float64)
        return np.asarray(total / (height * width))

    @cached_property
    def raw_from_stab(self) -> Transform:
        """Maps stabilized pixels to raw-frame pixels: the inverse transform (eq. 9)."""
        return inverse(self.stab_from_raw)

    @cached_property
    def is_raw(self) -> bool:
        """Whether this view is the raw frame."""
        return self.stab_from_raw is IDENTITY or self.stab_from_raw.tolist() == _IDENTITY_ROWS

    def crop(
        self,
        xywh: Sequence[float],
        out_wh: tuple[int, int],
        fill: Sequence[float] | Color | None = None,
    ) -> Crop:
        """Crop a rectangle of the stabilized frame, stretched to `out_wh`, in one warp.

        The rectangle is not rounded to whole pixels, and may be partly or wholly outside of the
        frame.

        Parameters
        ----------
        xywh : (x, y, w, h)
            Stabilized pixels; (0, 0) is the top left corner of the first pixel.
        out_wh : (int, int)
            Width and height of the result, pixels.
        fill : (3,) floats, optional
            Color outside of the frame, BGR; its fractions are truncated. By default black.

        Raises
        ------
        ArgumentError
            The rectangle is empty or not finite, or the output size or the color is not one.
        """
        x, y, w, h = xywh_floats(xywh, "crop")
        if not np.isfinite((x, y, w, h)).all() or w <= 0 or h <= 0:
            raise ArgumentError(f"crop {(x, y, w, h)} is empty or not finite: give x, y, w, h")
        size_wh = _checked_size(out_wh)
        across, down = w / size_wh[0], h / size_wh[1]
        view_from_crop = np.array([[across, 0, x], [0, down, y], [0, 0, 1]])
        return Crop(self._rectangle((x, y, w, h), size_wh, _color(fill)), view_from_crop)

    def crop_square(
        self, center_xy: tuple[float, float], side: int, out: int, fill: Sequence[float] | Color
    ) -> Image:
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
        fill : (3,) floats
            Color outside of the frame, BGR; its fractions are truncated.
        """
        # The reference trackers round the corner center - (side + 1) / 2 half up.
        left, top = (int(np.floor(c - (side + 1) / 2 + 0.5)) for c in center_xy)
        if self.is_raw:
            return _subwindow(self.raw, left, top, side, out, _color(fill))
        return self._rectangle((left, top, side, side), (out, out), _color(fill))

    def _rectangle(self, xywh: XYWH, out_wh: tuple[int, int], color: list[float]) -> Image:
        """A rectangle of the stabilized frame, stretched to `out_wh`: (H, W, 3) uint8 BGR."""
        x, y, w, h = xywh
        across, down = w / out_wh[0], h / out_wh[1]
        # The center of pixel p is at p + 0.5.
        stab_from_crop = np.array(
            [[across, 0, x + across / 2 - 0.5], [0, down, y + down / 2 - 0.5], [0, 0, 1]]
        )
        return _warp(self.raw, self.raw_from_stab @ stab_from_crop, out_wh, color)

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


def _color(fill: Sequence[float] | Color | None) -> list[float]:
    """The fill color for OpenCV, without its fractions; black by default."""
    if fill is None:
        return [0.0, 0.0, 0.0]
    values = finite_array(fill)
    if values is None or values.shape != (3,):
        raise ArgumentError(f"fill {short_repr(fill)} is not a color: give three numbers, BGR")
    color: list[float] = np.trunc(values).tolist()
    return color


def _checked_size(size_wh: tuple[int, int]) -> tuple[int, int]:
    """Width and height of a crop; `ArgumentError` unless they are whole numbers within limits."""
    sizes = finite_array(size_wh)
    if (
        sizes is None
        or sizes.shape != (2,)
        or not (sizes == np.clip(np.rint(sizes), 1, _MAX_CROP)).all()
    ):
        raise ArgumentError(
            f"crop size {short_repr(size_wh)}: give (width, height), 1 to {_MAX_CROP} pixels"
        )
    width, height = sizes.astype(int).tolist()
    return width, height


def _per_channel(name: str, value: PerChannel) -> NDArray[np.float32]:
    """One number or three, in a shape that applies to (1, 3, H, W)."""
    values = finite_array(value)
    if values is None or values.shape not in ((), (3,)):
        raise ArgumentError(f"{name} {short_repr(value)}: give one number, or one per channel")
    return values.astype(np.float32).reshape(-1, 1, 1)


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
    """Warp to (width, height) pixels: pixel p is the raw frame at ``raw_from_out @ p``.

    OpenCV warps four channels twice as fast as three, with equal pixels. They are made of the part
    that is read, if that is not large.
    """
    part = _part_read(raw_from_out, size_wh, raw.shape[1], raw.shape[0])
    if part is None:
        return _warp_affine(raw, raw_from_out, size_wh, color)
    four = _FOUR_CHANNELS.of_size(raw.shape[1], raw.shape[0])
    cv2.cvtColor(raw[part], cv2.COLOR_BGR2BGRA, dst=four[part])
    warped = _warp_affine(four, raw_from_out, size_wh, [*color, 0.0])
    return np.asarray(cv2.cvtColor(warped, cv2.COLOR_BGRA2BGR), dtype=np.uint8)


def _warp_affine(
    image: Image, image_from_out: Transform, size_wh: tuple[int, int], color: list[float]
) -> Image:
    warped = cv2.warpAffine(
        image,
        image_from_out[:2],
        size_wh,
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=color,
    )
    return np.asarray(warped, dtype=np.uint8)


def _part_read(
    raw_from_out: Transform, size_wh: tuple[int, int], width: int, height: int
) -> tuple[slice, slice] | None:
    """Rows and columns of a raw frame that a warp reads; None if they are none or too many."""
    (a, b, c), (d, e, f), _ = raw_from_out.tolist()
    right, bottom = size_wh[0] - 1, size_wh[1] - 1
    x, y = c + min(a * right, 0) + min(b * bottom, 0), f + min(d * right, 0) + min(e * bottom, 0)
    w, h = abs(a) * right + abs(b) * bottom, abs(d) * right + abs(e) * bottom
    if not (w * h <= _MAX_READ * right * bottom and width * height <= _MAX_FOUR_CHANNELS):
        return None
    if not (-w < x < width and -h < y < height):
        return None
    left, top = max(int(x) - _RIM, 0), max(int(y) - _RIM, 0)
    return slice(top, int(y + h) + _RIM + 1), slice(left, int(x + w) + _RIM + 1)


class _FourChannels(threading.local):
    """An image of four channels for each thread, used again for frames of the same size."""

    def __init__(self) -> None:
        self._image: Image = np.empty((0, 0, 4), np.uint8)

    def of_size(self, width: int, height: int) -> Image:
        """The image (H, W, 4), with any content."""
        if self._image.shape != (height, width, 4):
            self._image = np.empty((height, width, 4), np.uint8)
        return self._image


_FOUR_CHANNELS: Final = _FourChannels()


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
