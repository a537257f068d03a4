"""Boxes, corners, masks and 3×3 transforms.

Conventions of the whole package: pixels, x right, y down, 0-based; angles in radians, positive =
clockwise on screen (x toward y). A transform is a (3, 3) float64 array named ``to_from_from``:
``stab_from_raw @ (x, y, 1)`` maps a raw-frame point to the stabilized frame. Names of boxes end in
their layout: ``xywh`` (left, top, width, height), ``corners`` (4, 2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from contextlib import suppress
from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.errors import ArgumentError, FrameSizeError

Transform: TypeAlias = NDArray[np.float64]
Points: TypeAlias = NDArray[np.float64]
Image: TypeAlias = NDArray[np.uint8]
Mask: TypeAlias = NDArray[np.bool_]
XYWH: TypeAlias = tuple[float, float, float, float]

_MAX_BOX: Final = 2  # frame widths, and frame heights
_MAX_REPR: Final = 80  # characters of a value in a message

IDENTITY: Transform = np.eye(3)
IDENTITY.flags.writeable = False


def rigid(dx: float, dy: float, angle: float, center_xy: Sequence[float] = (0.0, 0.0)) -> Transform:
    """Rotation (3, 3) by `angle` about `center_xy`, followed by the shift (dx, dy).

    Eq. 7 of the paper, with the misprinted sign corrected. Pixels and radians.
    """
    cos, sin = math.cos(angle), math.sin(angle)
    cx, cy = center_xy
    return np.array(
        [
            [cos, -sin, cx - cos * cx + sin * cy + dx],
            [sin, cos, cy - sin * cx - cos * cy + dy],
            [0.0, 0.0, 1.0],
        ]
    )


def rigid_parameters(
    to_from_from: Transform, center_xy: Sequence[float]
) -> tuple[float, float, float]:
    """(dx, dy, angle) of a transform at `center_xy`: the inverse of `rigid`, eq. 4 of the paper.

    The shift is that of the center; at the image origin, half a degree of roll would appear as
    several pixels of shift. For an affine transform or a homography, the angle is that of the
    nearest similarity at the center.
    """
    (a, b, c), (d, e, f), (g, h, i) = to_from_from.tolist()
    x, y = center_xy
    weight = g * x + h * y + i
    new_x, new_y = (a * x + b * y + c) / weight, (d * x + e * y + f) / weight
    rotation, zoom = d - b - g * new_y + h * new_x, a + e - g * new_x - h * new_y
    return new_x - x, new_y - y, math.atan2(rotation * weight, zoom * weight)


def inverse(to_from_from: Transform) -> Transform:
    """The inverse of a transform: the adjugate matrix, divided by the determinant.

    Several times as fast as `numpy.linalg.inv`, whose results differ by rounding.

    Raises
    ------
    numpy.linalg.LinAlgError
        The determinant is 0.
    """
    (a, b, c), (d, e, f), (g, h, i) = to_from_from.tolist()
    first, second, third = e * i - f * h, f * g - d * i, d * h - e * g
    determinant = a * first + b * second + c * third
    if determinant == 0:
        raise np.linalg.LinAlgError("singular transform")
    adjugate: Transform = np.array(
        [
            [first, c * h - b * i, b * f - c * e],
            [second, a * i - c * g, c * d - a * f],
            [third, b * g - a * h, a * e - b * d],
        ]
    )
    return np.asarray(adjugate / determinant)


def frame_center(size_wh: tuple[int, int]) -> tuple[float, float]:
    """Center of a frame of (width, height) pixels; integers are pixel centers."""
    return (size_wh[0] - 1) / 2, (size_wh[1] - 1) / 2


def map_points(to_from_from: Transform, points: ArrayLike) -> Points:
    """Map points (N, 2) by a transform, with homogeneous division; returns (N, 2) float64."""
    xy = np.asarray(points, dtype=np.float64)
    mapped = xy @ to_from_from[:2, :2].T + to_from_from[:2, 2]
    weight = xy @ to_from_from[2, :2] + to_from_from[2, 2]
    return np.asarray(mapped / weight[..., None], dtype=np.float64)


def map_point(to_from_from: Transform, x: float, y: float) -> tuple[float, float]:
    """Map one point by a transform; ten times faster than `map_points`."""
    return _mapped(to_from_from.tolist(), x, y)


def map_box(to_from_from: Transform, xywh: Sequence[float]) -> XYWH:
    """Map an upright box by a transform: its center is mapped, its sides are scaled.

    The scale is the transform's local zoom (1 for a rigid one), so that the inverse transform
    restores the box; the bounding box of the rotated corners would grow at every step.
    """
    x, y, w, h = map(float, xywh)
    x, y = x + w / 2, y + h / 2
    rows = to_from_from.tolist()
    zoom = _zoom(rows, x, y)
    cx, cy = _mapped(rows, x, y)
    return cx - w * zoom / 2, cy - h * zoom / 2, w * zoom, h * zoom


def local_zoom(to_from_from: Transform, point_xy: Sequence[float]) -> float:
    """Square root of the area of a unit square at `point_xy` after the transform."""
    x, y = point_xy
    return _zoom(to_from_from.tolist(), x, y)


def map_mask(to_from_from: Transform, mask: Mask, size_wh: tuple[int, int]) -> Mask:
    """Map a mask (H, W) bool to a frame of (width, height) pixels, by nearest neighbor."""
    pixels, nearest = mask.view(np.uint8), cv2.INTER_NEAREST
    if np.array_equal(to_from_from[2], IDENTITY[2]):
        return cv2.warpAffine(pixels, to_from_from[:2], size_wh, flags=nearest).astype(np.bool_)
    return cv2.warpPerspective(pixels, to_from_from, size_wh, flags=nearest).astype(np.bool_)


def mask_bounds(mask: Mask) -> tuple[slice, slice]:
    """Rows and columns of the smallest upright box around a mask's target, (H, W) bool.

    Both are ``slice(0, 0)`` for an empty mask.
    """
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def corners_from_xywh(xywh: Sequence[float]) -> Points:
    """Corners (4, 2) of an upright box: top left, top right, bottom right, bottom left."""
    x, y, w, h = xywh
    return np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]], dtype=np.float64)


def xywh_from_corners(corners: ArrayLike) -> XYWH:
    """Upright bounding box of corners (N, 2)."""
    xy = np.asarray(corners, dtype=np.float64)
    (left, top), (right, bottom) = xy.min(axis=0), xy.max(axis=0)
    return float(left), float(top), float(right - left), float(bottom - top)


def area_preserving_xywh(corners: ArrayLike, center_inset: float = 1.0) -> XYWH:
    """Upright box with the center and area of a rotated box (4, 2), used to start VOT trackers.

    The mean of the corners is at ``x + (w - center_inset) / 2``: by default the center of the
    box's pixels, as in most reference trackers.
    """
    xy = np.asarray(corners, dtype=np.float64).reshape(4, 2)
    cx, cy = xy.mean(axis=0)
    span_w, span_h = xy.max(axis=0) - xy.min(axis=0)
    area = np.linalg.norm(xy[0] - xy[1]) * np.linalg.norm(xy[1] - xy[2])
    shrink = np.sqrt(area / (span_w * span_h))
    w, h = shrink * span_w + 1, shrink * span_h + 1
    left, top = cx - (w - center_inset) / 2, cy - (h - center_inset) / 2
    return float(left), float(top), float(w), float(h)


def iou(xywh: ArrayLike, other: ArrayLike) -> Points:
    """Intersection over union (...) of boxes x, y, w, h (..., 4); nan where a box has nan."""
    a, b = np.asarray(xywh, dtype=np.float64), np.asarray(other, dtype=np.float64)
    low = np.maximum(a[..., :2], b[..., :2])
    high = np.minimum(a[..., :2] + a[..., 2:], b[..., :2] + b[..., 2:])
    intersection = np.maximum(high - low, 0).prod(axis=-1)
    area, other_area = (np.maximum(box[..., 2:], 0).prod(axis=-1) for box in (a, b))
    union = area + other_area - intersection
    return np.asarray(intersection / np.where(union == 0, 1, union))


def center_distance(xywh: XYWH, other_xywh: XYWH) -> float:
    """Distance of the centers of two boxes, in sizes (square root of the area) of the second."""
    (x, y, w, h), (u, v, p, q) = xywh, other_xywh
    return math.hypot(x + w / 2 - u - p / 2, y + h / 2 - v - q / 2) / math.sqrt(p * q)


def check_box(xywh: Sequence[float], size_wh: tuple[int, int]) -> XYWH:
    """Check a target box.

    It must be finite, at least one pixel wide and high, overlap the frame of `size_wh` = (width,
    height) pixels, and be at most twice as wide and twice as high as the frame: the memory that
    trackers need grows with the box.

    Returns
    -------
    (x, y, w, h) floats

    Raises
    ------
    ArgumentError
        The box is not valid.
    """
    values = xywh_floats(xywh)
    x, y, w, h = values
    if not np.isfinite(values).all():
        raise ArgumentError(
            f"box {values} has a number that is not finite: give x, y, width, height in pixels"
        )
    if w < 1 or h < 1:
        raise ArgumentError(
            f"box {values} is empty: width and height must be at least 1 pixel "
            "(x, y is the top left corner)"
        )
    width, height = size_wh
    if x >= width or y >= height or x + w <= 0 or y + h <= 0:
        raise ArgumentError(f"box {values} is outside of the frame of {width}x{height} pixels")
    if w > _MAX_BOX * width or h > _MAX_BOX * height:
        raise ArgumentError(
            f"box {values} is more than {_MAX_BOX} times the frame of {width}x{height} pixels: "
            "give a box of about the target's size"
        )
    return x, y, w, h


def xywh_floats(xywh: Any, name: str = "box") -> XYWH:
    """Convert x, y, width, height to floats.

    Raises
    ------
    ArgumentError
        It is not a sequence of four numbers, or is text, a set or a mapping; the message calls it
        `name`.
    """
    values: list[float] | None = None
    if not isinstance(xywh, str | bytes | Set | Mapping):
        with suppress(TypeError, ValueError, OverflowError):
            values = [_number(value) for value in xywh]
    if values is None:
        raise ArgumentError(
            f"{name} is {short_repr(xywh)}: give four numbers, x, y, width, height in pixels"
        )
    if len(values) != 4:
        raise ArgumentError(
            f"{name} {short_repr(xywh)} has {len(values)} numbers: "
            "give x, y, width, height in pixels"
        )
    x, y, w, h = values
    return x, y, w, h


def finite_array(values: Any) -> NDArray[np.float64] | None:
    """Convert numbers to a float64 array; None if they are ragged, text or not all finite."""
    try:
        plain = np.asarray(values)
        if plain.dtype.kind not in "biuf":
            return None
        array = plain.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return array if np.isfinite(array).all() else None


def check_frame(
    frame: Image, size_wh: tuple[int, int] | None = None, *, may_be_gray: bool = False
) -> tuple[int, int]:
    """Check a frame.

    Parameters
    ----------
    frame : (H, W, 3) uint8 BGR
    size_wh : (int, int), optional
        Width and height of the previous frames, pixels.
    may_be_gray : bool
        Whether (H, W) is accepted too.

    Returns
    -------
    (int, int)
        Width and height, pixels.

    Raises
    ------
    ArgumentError
        The frame is not a non-empty (H, W, 3) uint8 array, or (H, W) if it may be.
    FrameSizeError
        The size of the frame is not `size_wh`.
    """
    is_array = isinstance(frame, np.ndarray)
    is_gray = may_be_gray and is_array and frame.ndim == 2
    if not is_array or frame.dtype != np.uint8 or not (frame.ndim == 3 or is_gray):
        actual = f"{frame.shape} {frame.dtype}" if is_array else type(frame).__name__
        gray = " or a (height, width) uint8 gray" if may_be_gray else ""
        raise ArgumentError(f"a frame is a (height, width, 3) uint8 BGR{gray} array, not {actual}")
    height, width = frame.shape[:2]
    if not (is_gray or frame.shape[2] == 3) or frame.size == 0:
        raise ArgumentError(
            f"a frame has 3 channels and at least one pixel, not the shape {frame.shape}"
        )
    if size_wh not in (None, (width, height)):
        raise FrameSizeError(
            f"frame of {width}x{height} pixels after frames of "
            f"{size_wh[0]}x{size_wh[1]}: all frames of a stream must have one size"
        )
    return width, height


def png_bytes(image: Image) -> bytes:
    """A BGR image as the content of a PNG file."""
    return cv2.imencode(".png", image)[1].tobytes()


def short_repr(value: Any) -> str:
    """The repr of a value in one line, cut after 80 characters."""
    text = " ".join(repr(value).split())
    return text if len(text) <= _MAX_REPR else f"{text[:_MAX_REPR]}..."


def _mapped(rows: list[list[float]], x: float, y: float) -> tuple[float, float]:
    """`map_point`, by the rows of the transform."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    weight = g * x + h * y + i
    return (a * x + b * y + c) / weight, (d * x + e * y + f) / weight


def _zoom(rows: list[list[float]], x: float, y: float) -> float:
    """`local_zoom`, by the rows of the transform."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return math.sqrt(abs(determinant / (g * x + h * y + i) ** 3))


def _number(value: Any) -> float:
    """A scalar as a float; `TypeError` for text and arrays."""
    if isinstance(value, str | bytes) or np.ndim(value) != 0:
        raise TypeError
    return float(value)
