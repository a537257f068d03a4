"""The part of the frames that shows the scene: without bars at the sides, above and below.

A bar never moves. Its edge is the longest and strongest of the frame, so an estimate that counts it
says that the camera stood still. Frames are therefore cut to their content before anything is
estimated, which gives exactly the motion of the cut video.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image

_LONGER_SIDE: Final = 320  # px of the small frame on which bars are measured
_FLAT: Final = 3  # gray levels by which a bar of one color differs from it, small frame
_CLEAN: Final = 8  # the same in the full frame, beside the ringing of a codec
_STRAY: Final = 0.02  # share of a line's pixels that may differ by more
_BLEND: Final = 0.6  # of the contrast of the next line: less is a blend of bar and content
_SMOOTH: Final = 6  # gray levels: the largest second difference in a blurred bar
_STEP: Final = 8  # gray levels across the edge of a blurred bar
_STRAIGHT: Final = 0.5  # share of the edge of a blurred bar that shows the step
_SHARPER: Final = 4.0  # detail of the content next to it, in that of a blurred bar
_BLURRED: Final = 8  # px of the small frame, the least depth of a blurred bar
_EVEN: Final = 2  # px of the small frame by which opposite blurred bars may differ
_LEAST: Final = 8  # px of the small frame: content that is smaller is none
_PATIENCE: Final = 64  # frames, at most, before a depth that was wrong once is believed again

_Gray = NDArray[np.int16]
_SIDES: Final = ("left", "top", "right", "bottom")


class Area(NamedTuple):
    """Pixels [left, right) x [top, bottom) of a frame."""

    left: int
    top: int
    right: int
    bottom: int

    def of(self, frame: Image) -> Image:
        """This part of a frame, not copied."""
        return frame[self.top : self.bottom, self.left : self.right]


class Content:
    """Follows which part of the frames of one size shows the scene.

    A bar counts from the first frame on. A side where something appears in what was taken for a
    bar gets it back at once, and has to show the same bar for longer before it counts again: twice
    as long each time, so that a flat sky costs next to nothing.

    Attributes
    ----------
    area : Area
    """

    def __init__(self, size_wh: tuple[int, int]) -> None:
        width, height = size_wh
        self._size_wh = size_wh
        self._scale = max(max(size_wh) / _LONGER_SIDE, 1.0)
        self._small_wh = max(round(width / self._scale), 1), max(round(height / self._scale), 1)
        self._depths = [0] * 4  # px of the frame that are cut off, in the order of `_SIDES`
        self._pending: list[tuple[int, int]] = [(0, 0)] * 4  # another depth, frames it was seen
        self._patience = [1] * 4  # frames for which it must be seen
        self.area = Area(0, 0, width, height)

    def update(self, frame: Image) -> bool:
        """Take the next frame (H, W, 3) uint8; whether `area` is another from now on."""
        if not any(self._depths) and not _may_have_bars(frame):
            self._pending = [(0, 0)] * 4
            return False
        found = self._found(frame)
        if found is None:
            return False
        for side, depth in enumerate(found):
            self._depths[side] = self._settled(side, depth)
        left, top, right, bottom = self._depths
        width, height = self._size_wh
        area = Area(left, top, width - right, height - bottom)
        changed, self.area = area != self.area, area
        return changed

    def _settled(self, side: int, depth: int) -> int:
        """The depth of a side's bar, of what was seen in this frame and before."""
        now = self._depths[side]
        if depth < now:
            self._patience[side] = min(2 * self._patience[side], _PATIENCE)
            self._pending[side] = 0, 0
            return depth
        if depth == now:
            self._pending[side] = 0, 0
            return now
        before, frames = self._pending[side]
        frames = frames + 1 if depth == before else 1
        self._pending[side] = depth, frames
        return depth if frames >= self._patience[side] else now

    def _found(self, frame: Image) -> list[int] | None:
        """Depth of the bar at each side, pixels; None if nothing else is seen."""
        small = cv2.resize(frame, self._small_wh, interpolation=cv2.INTER_AREA)
        gray = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY).astype(np.int16)
        flat = [_flat_depth(_from(gray, side)) for side in range(4)]
        if _nothing_left(flat, gray.shape):
            return None
        blurred = [0 if flat[side] else _blurred_depth(_from(gray, side)) for side in range(4)]
        depths = []
        for side in range(4):
            lines = _from(frame, side)
            opposite = blurred[(side + 2) % 4]
            if flat[side]:
                depths.append(_flat_edge(lines, flat[side], self._scale))
            elif blurred[side] and abs(blurred[side] - opposite) <= _EVEN:
                depths.append(_blurred_edge(lines, blurred[side], self._scale))
            else:
                depths.append(0)
        return depths


def _may_have_bars(frame: Image) -> bool:
    """Whether a side's outermost line is smooth enough for a bar; a few microseconds."""
    for side in range(4):
        line = _from(frame, side)[:, 0, 1].astype(np.int16)  # green
        line = line[: len(line) // 8 * 8].reshape(-1, 8).mean(axis=1)
        if len(line) < 3 or np.abs(np.diff(line, 2)).max() <= 2 * _SMOOTH:
            return True
    return False


def _from(frame: NDArray[Any], side: int) -> NDArray[Any]:
    """A view in which the lines along a side are columns, counted from that side."""
    turned = frame.swapaxes(0, 1) if side % 2 else frame
    return turned[:, ::-1] if side >= 2 else turned


def _nothing_left(depths: list[int], shape: tuple[int, ...]) -> bool:
    left, top, right, bottom = depths
    height, width = shape
    return width - left - right < _LEAST or height - top - bottom < _LEAST


def _flat_depth(lines: _Gray) -> int:
    """Columns from the side on that have one color."""
    off = np.abs(lines - int(np.median(lines[:, 0]))).max(axis=0) > _FLAT
    return int(off.argmax()) if off.any() else lines.shape[1]


def _flat_edge(lines: Image, depth: int, scale: float) -> int:
    """The first column of the full frame that shows content, next to `depth` of the small one."""
    first = max(int((depth - 2) * scale), 0)
    last = min(int((depth + 3) * scale) + 3, lines.shape[1])
    near = cv2.cvtColor(np.ascontiguousarray(lines[:, first:last]), cv2.COLOR_BGR2GRAY)
    color = int(np.median(lines[:, 0].mean(axis=-1)))
    away = np.abs(near.astype(np.int16) - color)
    edge = int(((away > _CLEAN).mean(axis=0) > _STRAY).argmax())
    contrast = away.mean(axis=0)
    for _ in range(2):
        if edge + 1 < len(contrast) and contrast[edge] < _BLEND * contrast[edge + 1]:
            edge += 1
    return first + edge


def _blurred_depth(lines: _Gray) -> int:
    """Columns from the side on that are smooth and end in a straight step; 0 if they do not."""
    detail = np.abs(lines[4:] - 2 * lines[2:-2] + lines[:-4])
    smooth = (detail > _SMOOTH).mean(axis=0) <= _STRAY
    depth = int((~smooth).argmax()) if not smooth.all() else 0
    if depth < _BLURRED or depth + _BLURRED > lines.shape[1] // 2 + _BLURRED:
        return 0
    inside, outside = detail[:, depth : depth + _BLURRED].mean(), detail[:, :depth].mean()
    step = np.abs(lines[:, depth + 1] - lines[:, depth - 2]) >= _STEP
    straight = float(step.mean()) >= _STRAIGHT and inside >= _SHARPER * max(float(outside), 0.1)
    return depth if straight else 0


def _blurred_edge(lines: Image, depth: int, scale: float) -> int:
    """The first column of the full frame behind the step next to `depth` of the small one."""
    first = max(int((depth - 2) * scale), 0)
    near = lines[:, first : int((depth + 3) * scale) + 3].astype(np.int16)
    steps = np.abs(np.diff(near, axis=1)).mean(axis=(0, 2))
    return first + int(steps.argmax()) + 1
