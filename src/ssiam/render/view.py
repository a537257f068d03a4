"""`CameraView`: what a virtual camera shows of a frame; `Renderer` makes its image."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.errors import check_choice
from ssiam.geometry import (
    IDENTITY,
    Image,
    Transform,
    corners_from_xywh,
    map_points,
    mask_bounds,
)
from ssiam.motion import Motion

Border: TypeAlias = Literal["black", "mirror", "fill"]
BORDERS: Final[tuple[Border, ...]] = get_args(Border)

# Frames from which "fill" takes the missing pixels: 6 of the last second and a half at 30 fps.
_NEIGHBORS: Final = 6
_NEIGHBOR_STEP: Final = 8  # frames between them
_TOLERANCE: Final = 0.05  # px of border that nobody sees
_INTERPOLATED: Final = 1  # px around a position that the interpolation reads
_EDGE: Final = 2  # px at a frame's edge that are not used: the interpolation mixes them with black


@dataclass(frozen=True, eq=False)
class CameraView:
    """What a virtual camera shows of a frame.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    out_from_raw : (3, 3) float64
        Maps raw-frame pixels to pixels of the written image.
    size_wh : (int, int)
        Width and height of the written image, pixels.
    """

    out_from_raw: Transform
    size_wh: tuple[int, int]

    @classmethod
    def raw(cls, size_wh: tuple[int, int]) -> CameraView:
        """The raw frame, of (width, height) pixels."""
        return cls(IDENTITY, size_wh)

    def is_filled_by(self, raw_wh: tuple[int, int]) -> bool:
        """Whether a frame of (width, height) pixels covers the whole image."""
        inner = (-0.5, -0.5, *self.size_wh)
        raw_from_out = np.asarray(np.linalg.inv(self.out_from_raw), dtype=np.float64)
        raw = map_points(raw_from_out, corners_from_xywh(inner))
        low, high = np.full(2, -0.5), np.array(raw_wh) - 0.5
        return bool((raw >= low - _TOLERANCE).all() and (raw <= high + _TOLERANCE).all())


class Renderer(DeepCopied):
    """Makes the images of a virtual camera, in the order of the frames.

    Threads: one thread at a time.

    Parameters
    ----------
    border : {"black", "mirror", "fill"}
        What is shown beyond the edges of the raw frame: black, its mirror image, or what earlier
        frames showed there (of the last 48 frames; the mirror image where none did).

    Raises
    ------
    ArgumentError
        `border` is none of these.
    """

    def __init__(self, border: Border = "mirror") -> None:
        self._border = check_choice("border", border, BORDERS)
        self._neighbors: deque[_Neighbor] = deque(maxlen=_NEIGHBORS)
        self._count = 0

    def render(self, raw: Image, view: CameraView, motion: Motion | None = None) -> Image:
        """The image of `view` (h, w, 3) uint8 BGR; one warp of the raw frame.

        A view of the raw frame is the frame itself, not a copy.

        Parameters
        ----------
        raw : (H, W, 3) uint8 BGR
            Must not be written to later if the border is "fill".
        view : CameraView
        motion : Motion, optional
            Camera motion to this frame, for "fill". Without it, or if it is not reliable, the
            earlier frames are forgotten.
        """
        raw_wh = raw.shape[1], raw.shape[0]
        if view.size_wh == raw_wh and np.array_equal(view.out_from_raw, IDENTITY):
            image = raw
        else:
            mode = cv2.BORDER_CONSTANT if self._border == "black" else cv2.BORDER_REFLECT_101
            image = _warp(raw, view.out_from_raw, view.size_wh, mode)
        if self._border == "fill":
            self._advance(motion)
            if not view.is_filled_by(raw_wh):
                self._fill(image, raw_wh, view)
            if self._count % _NEIGHBOR_STEP == 0:
                self._neighbors.appendleft(_Neighbor(raw, IDENTITY))
            self._count += 1
        return image

    def _advance(self, motion: Motion | None) -> None:
        """Relate the neighbors to the frame that `motion` reaches."""
        if motion is None or not motion.reliable:
            self._neighbors.clear()
            self._count = 0
            return
        for neighbor in self._neighbors:
            neighbor.cur_from_raw = motion.cur_from_prev @ neighbor.cur_from_raw

    def _fill(self, image: Image, raw_wh: tuple[int, int], view: CameraView) -> None:
        """Fill the pixels that the frame does not cover from its neighbors, the latest first."""
        missing = ~_covered(raw_wh, view.out_from_raw, view.size_wh)
        for neighbor in self._neighbors:
            if not missing.any():
                return
            out_from_neighbor = view.out_from_raw @ neighbor.cur_from_raw
            found = missing & _covered(raw_wh, out_from_neighbor, view.size_wh)
            region = rows, columns = mask_bounds(found)
            chosen = found[region]
            if not chosen.size:
                continue
            out_from_neighbor[:2] -= np.outer((columns.start, rows.start), out_from_neighbor[2])
            height, width = chosen.shape
            part = _warp(neighbor.raw, out_from_neighbor, (width, height), cv2.BORDER_REFLECT_101)
            image[region][chosen] = part[chosen]
            missing &= ~found


@dataclass
class _Neighbor:
    """An earlier frame, and the transform from its pixels to those of the current frame."""

    raw: Image
    cur_from_raw: Transform


def _warp(raw: Image, out_from_raw: Transform, size_wh: tuple[int, int], border: int) -> Image:
    """Pixel p of the result is the raw frame at the inverse of `out_from_raw`.

    OpenCV 5 warps four channels in less than half of the time that it needs for three.
    """
    part, out_from_raw = _shown_part(raw, out_from_raw, size_wh)
    padded = cv2.cvtColor(part, cv2.COLOR_BGR2BGRA)
    if np.array_equal(out_from_raw[2], IDENTITY[2]):
        warped = cv2.warpAffine(
            padded, out_from_raw[:2], size_wh, flags=cv2.INTER_LINEAR, borderMode=border
        )
    else:
        warped = cv2.warpPerspective(
            padded, out_from_raw, size_wh, flags=cv2.INTER_LINEAR, borderMode=border
        )
    return np.asarray(cv2.cvtColor(warped, cv2.COLOR_BGRA2BGR), dtype=np.uint8)


def _shown_part(
    raw: Image, out_from_raw: Transform, size_wh: tuple[int, int]
) -> tuple[Image, Transform]:
    """The part of the frame that an image shows, if it shows no border, and its transform."""
    raw_from_out = np.asarray(np.linalg.inv(out_from_raw), dtype=np.float64)
    shown = map_points(raw_from_out, corners_from_xywh((0, 0, size_wh[0] - 1, size_wh[1] - 1)))
    left, top = np.floor(shown.min(axis=0)).astype(int) - _INTERPOLATED
    right, bottom = np.ceil(shown.max(axis=0)).astype(int) + _INTERPOLATED + 1
    if left < 0 or top < 0 or right > raw.shape[1] or bottom > raw.shape[0]:
        return raw, out_from_raw
    raw_from_part = np.array([[1.0, 0, left], [0, 1, top], [0, 0, 1]])
    return raw[top:bottom, left:right], np.asarray(out_from_raw @ raw_from_part)


def _covered(
    raw_wh: tuple[int, int], out_from_raw: Transform, size_wh: tuple[int, int]
) -> NDArray[np.bool_]:
    """Which pixels (h, w) of the image the inside of a frame covers."""
    width, height = raw_wh
    inside = corners_from_xywh((_EDGE, _EDGE, width - 1 - 2 * _EDGE, height - 1 - 2 * _EDGE))
    mask = np.zeros((size_wh[1], size_wh[0]), dtype=np.uint8)
    corners = np.rint(map_points(out_from_raw, inside)).astype(np.int32)
    cv2.fillConvexPoly(mask, corners, 1)
    return mask.view(np.bool_)
