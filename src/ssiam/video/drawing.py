"""Drawing tracks into frames, for people to look at."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.geometry import Image, corners_from_xywh
from ssiam.track import Track
from ssiam.video.lettering import BLACK, WHITE, Color, Lettering

# BGR; the hues of Okabe and Ito, which the colour-blind can tell apart, in bright versions.
COLORS: tuple[Color, ...] = (
    (60, 230, 90),
    (30, 160, 255),
    (255, 190, 60),
    (200, 120, 240),
    (70, 235, 245),
    (255, 120, 80),
)
_LOST_COLOR: Color = (70, 70, 255)
_MASK_SHARE = 0.4
# Points further out than this (pixels) are drawn there; OpenCV's shifted coordinates overflow.
_FAR = 1e5
_SHIFT = 4


def draw_tracks(
    image: Image,
    tracks: Sequence[Track],
    *,
    fps: float | None = None,
    numbers: Sequence[int] | None = None,
) -> Image:
    """A copy of the frame with every target drawn into it.

    A target gets its box, its rotated box and mask if it has them, and its score. A lost one
    gets no box, only the word LOST in the lower left corner. Several targets are numbered from 1
    and told apart by colour. Lines and letters grow with the frame.

    Parameters
    ----------
    image : (H, W, 3) uint8 BGR
        The raw frame; stays as it is.
    tracks : sequence of Track
        In raw-frame pixels, in the order of the targets.
    fps : float or None
        Frames a second, written in the upper right corner.
    numbers : sequence of int, optional
        The targets' own, from 1, where they come and go.
    """
    canvas = image.copy()
    lettering = Lettering.for_image(canvas)
    lost = []
    is_numbered = numbers is not None or len(tracks) > 1
    for number, track in zip(numbers or range(1, len(tracks) + 1), tracks, strict=True):
        called = f"{number} " if is_numbered else ""
        if track.lost:
            lost.append(f"{called}LOST")
        else:
            label = f"{called}{track.score:.2f}"
            _draw_target(canvas, track, label, COLORS[(number - 1) % len(COLORS)], lettering)
    for line, text in enumerate(reversed(lost)):
        lettering.write(canvas, text, _lower_left(canvas, lettering, line), _LOST_COLOR)
    if fps is not None:
        _write_fps(canvas, f"{fps:.1f} fps", lettering)
    return canvas


def _draw_target(
    canvas: Image, track: Track, label: str, color: Color, lettering: Lettering
) -> None:
    if track.mask is not None:
        _tint(canvas, track.mask, color)
    box = corners_from_xywh(track.box)
    if track.corners is None:
        _outline(canvas, box, color, lettering.thickness)
    else:
        _outline(canvas, box, color, lettering.thickness // 2, rim=0)
        _outline(canvas, track.corners, color, lettering.thickness)
    drawn = box if track.corners is None else np.vstack([box, track.corners])
    left, top = np.clip(drawn.min(axis=0), -_FAR, _FAR)
    bottom = float(np.clip(drawn[:, 1].max(), -_FAR, _FAR))
    lettering.write(canvas, label, _beside(canvas, left, top, bottom, lettering), color)


def _tint(canvas: Image, mask: NDArray[np.bool_], color: Color) -> None:
    """Blend the colour into the pixels of the mask; only their bounding box is touched."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return
    window = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    part, chosen = canvas[window], mask[window]
    share = np.array(color) * _MASK_SHARE
    part[chosen] = (part[chosen] * (1 - _MASK_SHARE) + share).astype(np.uint8)


def _outline(
    canvas: Image, corners: ArrayLike, color: Color, thickness: int, *, rim: int = 2
) -> None:
    """Closed polygon with a dark rim, so that it shows on every ground."""
    near = np.clip(np.asarray(corners, dtype=np.float64), -_FAR, _FAR)
    points = np.round(near * (1 << _SHIFT)).astype(np.int32)
    for shade, width in ((BLACK, thickness + rim), (color, thickness)):
        cv2.polylines(canvas, [points], True, shade, width, cv2.LINE_AA, _SHIFT)


def _beside(
    canvas: Image, left: float, top: float, bottom: float, lettering: Lettering
) -> tuple[float, float]:
    """Lower left corner of a label over the box; under its lower edge if there is no room."""
    over = top - lettering.gap
    if over >= lettering.line_height:
        return left, over
    return left, min(bottom + lettering.gap + lettering.line_height, canvas.shape[0])


def _lower_left(canvas: Image, lettering: Lettering, line: int) -> tuple[float, float]:
    """Place of a line of text, the lowest being line 0."""
    return lettering.gap, canvas.shape[0] - lettering.gap - line * lettering.line_height


def _write_fps(canvas: Image, text: str, lettering: Lettering) -> None:
    x = canvas.shape[1] - lettering.gap - lettering.width_of(text)
    lettering.write(canvas, text, (x, lettering.gap + lettering.line_height), WHITE)
