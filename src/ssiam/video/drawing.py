"""Drawing for display: tracks in frames, labels, and two images side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.geometry import Image, corners_from_xywh, mask_bounds
from ssiam.track import Track

_Color: TypeAlias = tuple[int, int, int]

Overlay: TypeAlias = Literal["none", "box", "box+score", "trail", "mask"]
"""What is drawn of a target, see `draw_tracks`."""

# BGR; brightened hues of Okabe and Ito, distinguishable with color blindness.
COLORS: tuple[_Color, ...] = (
    (60, 230, 90),
    (30, 160, 255),
    (255, 190, 60),
    (200, 120, 240),
    (70, 235, 245),
    (255, 120, 80),
)
_BLACK: _Color = (0, 0, 0)
_WHITE: _Color = (255, 255, 255)
_LOST_COLOR: _Color = (70, 70, 255)
_MASK_SHARE = 0.4
# Coordinates are clipped to this (pixels); OpenCV's fixed-point coordinates overflow.
_FAR = 1e5
_SHIFT = 4  # fractional bits of OpenCV's coordinates

_TICKS = 8  # of a ruler, at most

_LOST_SCALE = 2.0  # of the word LOST, relative to other text

_FONT = cv2.FONT_HERSHEY_SIMPLEX
# Font scale and line width for an image of 720 rows; smaller images get relatively more.
_REFERENCE_ROWS = 720
_FONT_SCALE = 0.9
_SMALLEST_FONT_SCALE = 0.5
_LINE_WIDTH = 3.0
_SMALLEST_LINE_WIDTH = 2


def draw_tracks(
    image: Image,
    tracks: Sequence[Track],
    *,
    fps: float | None = None,
    numbers: Sequence[int] | None = None,
    labels: Sequence[str] | None = None,
    overlay: Overlay = "box+score",
    trails: Sequence[ArrayLike] = (),
) -> Image:
    """Draw every target into a copy of the frame.

    A target gets its box, its rotated box and mask if it has them, and its score. A lost target
    gets no box, only the word LOST, large, in the lower left corner. Several targets have numbers,
    from 1, and different colors. Lines and letters scale with the frame.

    Parameters
    ----------
    image : (H, W, 3) uint8 BGR
        The raw frame; not modified.
    tracks : sequence of Track
        In raw-frame pixels, in the order of the targets.
    fps : float or None
        Frames per second, written in the upper right corner.
    numbers : sequence of int, optional
        Number of each target, from 1, for targets that come and go; 1, 2, ... by default. With
        `numbers`, a single target has a number too.
    labels : sequence of str, optional
        Label of each box; by default its number and its score.
    overlay : {"box+score", "box", "trail", "mask", "none"}
        "box" omits score, rotated box and mask, "trail" adds the path of each target to its box,
        "mask" draws nothing but the mask (the box of a target without one), "none" nothing, not
        even LOST.
    trails : sequence of (N, 2) array
        Earlier centers of each target, in pixels of this frame; drawn by "trail".

    Returns
    -------
    (H, W, 3) uint8 BGR
    """
    canvas = image.copy()
    if overlay == "none":
        return canvas
    style = _TextStyle.for_image(canvas)
    lost = []
    is_numbered = numbers is not None or len(tracks) > 1
    numbered = numbers or range(1, len(tracks) + 1)
    for index, (number, track) in enumerate(zip(numbered, tracks, strict=True)):
        prefix = f"{number} " if is_numbered else ""
        color = COLORS[(number - 1) % len(COLORS)]
        if overlay == "trail" and len(trails) > index:
            _draw_trail(canvas, trails[index], color, style)
        if track.lost:
            lost.append(f"{prefix}LOST")
            continue
        label = prefix.rstrip()
        if labels is not None:
            label = labels[index]
        elif overlay == "box+score":
            label = f"{prefix}{track.score:.2f}"
        _draw_target(canvas, track, label, color, style, overlay)
    large = style.scaled(_LOST_SCALE)
    for line, text in enumerate(reversed(lost)):
        large.write(canvas, text, _lower_left(canvas, large, line), _LOST_COLOR)
    if fps is not None:
        _write_fps(canvas, f"{fps:.1f} fps", style)
    return canvas


def _draw_target(
    canvas: Image, track: Track, label: str, color: _Color, style: _TextStyle, overlay: Overlay
) -> None:
    if overlay in ("box+score", "mask") and track.mask is not None:
        _tint(canvas, track.mask, color)
        if overlay == "mask":
            return
    box = corners_from_xywh(track.box)
    rotated = track.corners if overlay == "box+score" else None
    if rotated is None:
        _outline(canvas, box, color, style.thickness)
    else:
        _outline(canvas, box, color, style.thickness // 2, rim=0)
        _outline(canvas, rotated, color, style.thickness)
    drawn = box if rotated is None else np.vstack([box, rotated])
    left, top = np.clip(drawn.min(axis=0), -_FAR, _FAR)
    bottom = float(np.clip(drawn[:, 1].max(), -_FAR, _FAR))
    if label:
        style.write(canvas, label, _label_position(canvas, left, top, bottom, style), color)


def _draw_trail(canvas: Image, trail: ArrayLike, color: _Color, style: _TextStyle) -> None:
    points = np.asarray(trail, dtype=np.float64).reshape(-1, 2)
    if len(points) > 1:
        _outline(canvas, points, color, style.thickness, is_closed=False)


def _tint(canvas: Image, mask: NDArray[np.bool_], color: _Color) -> None:
    """Blend the color into the pixels of the mask; only their bounding box is touched."""
    region = mask_bounds(mask)
    if not mask[region].size:
        return
    part, chosen = canvas[region], np.ascontiguousarray(mask[region]).view(np.uint8)
    colored = np.empty_like(part)
    colored[:] = color
    tinted = cv2.addWeighted(part, 1 - _MASK_SHARE, colored, _MASK_SHARE, 0)
    canvas[region] = cv2.copyTo(tinted, chosen, part.copy())


def _outline(
    canvas: Image,
    corners: ArrayLike,
    color: _Color,
    thickness: int,
    *,
    rim: int = 2,
    is_closed: bool = True,
) -> None:
    """Polygon or line with a dark rim, visible on every background."""
    near = np.clip(np.asarray(corners, dtype=np.float64), -_FAR, _FAR)
    points = np.round(near * (1 << _SHIFT)).astype(np.int32)
    for shade, width in ((_BLACK, thickness + rim), (color, thickness)):
        cv2.polylines(canvas, [points], is_closed, shade, width, cv2.LINE_AA, _SHIFT)


def _label_position(
    canvas: Image, left: float, top: float, bottom: float, style: _TextStyle
) -> tuple[float, float]:
    """Lower left corner of a label above the box, or below it if there is no room."""
    above = top - style.gap
    if above >= style.line_height:
        return left, above
    return left, min(bottom + style.gap + style.line_height, canvas.shape[0])


def _lower_left(canvas: Image, style: _TextStyle, line: int) -> tuple[float, float]:
    """Position of a line of text, counted upwards from line 0 at the bottom."""
    return style.gap, canvas.shape[0] - style.gap - line * style.line_height


def _write_fps(canvas: Image, text: str, style: _TextStyle) -> None:
    x = canvas.shape[1] - style.gap - style.width_of(text)
    style.write(canvas, text, (x, style.gap + style.line_height), _WHITE)


def draw_rulers(image: Image) -> Image:
    """Draw pixel coordinates along the upper and the left edge of a copy of the frame.

    Parameters
    ----------
    image : (H, W, 3) uint8 BGR

    Returns
    -------
    (H, W, 3) uint8 BGR
        With about `_TICKS` ticks along the longer side.
    """
    canvas = image.copy()
    style = _TextStyle.for_image(canvas)
    height, width = canvas.shape[:2]
    step = _tick_step(max(width, height))
    length = 3 * style.gap
    for x in range(step, width, step):
        _outline(canvas, [(x, 0), (x, length)], _WHITE, 1)
        style.write(canvas, str(x), (x + style.gap, style.line_height), _WHITE)
    for y in range(step, height, step):
        _outline(canvas, [(0, y), (length, y)], _WHITE, 1)
        style.write(canvas, str(y), (style.gap, y + style.line_height), _WHITE)
    return canvas


def _tick_step(side: int) -> int:
    """Pixels between two ticks: the 1, 2 or 5 times a power of ten that gives about `_TICKS`."""
    power = int(10 ** np.floor(np.log10(max(side / _TICKS, 1))))
    return next(step for step in (power, 2 * power, 5 * power, 10 * power) if step * _TICKS >= side)


def side_by_side(raw: Image, stabilized: Image, name: str = "stabilized") -> Image:
    """Two panels of the size of `raw`, labeled "raw" and `name`.

    Parameters
    ----------
    raw : (H, W, 3) uint8 BGR
    stabilized : (h, w, 3) uint8 BGR
        If it has another size it is scaled to fit its panel, with its aspect ratio kept and black
        borders.
    name : str
        Label of the second panel.

    Returns
    -------
    (H, 2 W, 3) uint8 BGR
        A new image; the inputs are not modified.
    """
    size_wh = raw.shape[1], raw.shape[0]
    panels = [raw.copy(), _fitted(stabilized, size_wh)]
    for panel, label in zip(panels, ("raw", name), strict=True):
        style = _TextStyle.for_image(panel)
        style.write(panel, label, (style.gap, style.gap + style.line_height), _WHITE)
    return np.hstack(panels)


def _fitted(image: Image, size_wh: tuple[int, int]) -> Image:
    """A copy scaled to fit into `size_wh` (width, height), centered on black."""
    width, height = size_wh
    rows, columns = image.shape[:2]
    if (columns, rows) == size_wh:
        return image.copy()
    scale = min(width / columns, height / rows)
    inner_w, inner_h = max(1, round(columns * scale)), max(1, round(rows * scale))
    interpolation = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    panel = np.zeros((height, width, 3), dtype=np.uint8)
    left, top = (width - inner_w) // 2, (height - inner_h) // 2
    panel[top : top + inner_h, left : left + inner_w] = cv2.resize(
        image, (inner_w, inner_h), interpolation=interpolation
    )
    return panel


@dataclass(frozen=True)
class _TextStyle:
    """Outlined text scaled to an image: font scale, stroke and line height in pixels."""

    font_scale: float
    thickness: int
    line_height: int
    gap: int

    @classmethod
    def for_image(cls, image: Image) -> _TextStyle:
        """Sizes that are legible in this image, from 240 rows to 4K."""
        share = min(image.shape[:2]) / _REFERENCE_ROWS
        font_scale = max(_SMALLEST_FONT_SCALE, _FONT_SCALE * share)
        return cls._of(font_scale, max(_SMALLEST_LINE_WIDTH, round(_LINE_WIDTH * share)))

    @classmethod
    def _of(cls, font_scale: float, thickness: int) -> _TextStyle:
        (_, height), baseline = cv2.getTextSize("0", _FONT, font_scale, thickness)
        return cls(font_scale, thickness, height + baseline + thickness, 2 + thickness)

    def scaled(self, factor: float) -> _TextStyle:
        """Text of `factor` times this size."""
        return self._of(self.font_scale * factor, round(self.thickness * factor))

    def width_of(self, text: str) -> int:
        """Width of the text with its outline."""
        (width, _), _ = cv2.getTextSize(text, _FONT, self.font_scale, self._stroke)
        return width + 2 * self._rim

    def write(
        self, image: Image, text: str, lower_left: tuple[float, float], color: _Color
    ) -> None:
        """Write into the image, moved as far as needed to stay inside.

        `lower_left` is the (x, y) of the text line, including the part below the baseline.
        """
        letters = self._letters(text)
        rows, columns = image.shape[:2]
        left = round(max(0.0, min(lower_left[0], columns - letters.shape[1])))
        top = round(max(0.0, min(lower_left[1], rows) - letters.shape[0]))
        part = image[top : top + letters.shape[0], left : left + letters.shape[1]]
        letters = letters[: part.shape[0], : part.shape[1]]
        # Dilated, because bolder text is wider in OpenCV 5 and would not align as an outline.
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * self._rim + 1,) * 2)
        _blend(part, cv2.dilate(letters, kernel), _BLACK)
        _blend(part, letters, color)

    def _letters(self, text: str) -> NDArray[np.uint8]:
        """The text in white on black."""
        (_, height), baseline = cv2.getTextSize(text, _FONT, self.font_scale, self._stroke)
        size = height + baseline + 2 * self._rim, self.width_of(text)
        origin = self._rim, height + self._rim
        patch = np.zeros(size, dtype=np.uint8)
        cv2.putText(patch, text, origin, _FONT, self.font_scale, 255, self._stroke, cv2.LINE_AA)
        return patch

    @property
    def _stroke(self) -> int:
        """Width of the strokes; letters are thinner than the lines of boxes."""
        return max(1, round(self.thickness / 2))

    @property
    def _rim(self) -> int:
        """Width of the dark outline."""
        return max(1, self.thickness // 2)


def _blend(part: Image, share: NDArray[Any], color: _Color) -> None:
    """Blend the color into a part of an image, weighted by `share` (0..255)."""
    weight = share[..., None].astype(np.float32) / 255
    part[:] = np.round(part * (1 - weight) + weight * np.array(color, np.float32))
