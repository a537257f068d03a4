"""The part of the frames that shows the scene, without letterbox and pillarbox bars.

Bars never move, and their edges are the longest and strongest of the frame: an estimate that
includes them finds no motion. Frames are therefore cropped to their content first; the motion is
exactly that of the cropped video.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.motion.flat_areas import MAX_BLANK_DEVIATION
from ssiam.motion.pyramid import as_gray

_LONGER_SIDE: Final = 320  # px of the small frame on which bars are measured
_MIN_CONTENT: Final = 8  # px of the small frame
_MAX_PATIENCE: Final = 64  # frames before a bar that disappeared is accepted again

# Quick tests of the outermost lines
_BIN: Final = 8  # px of a line that are averaged
_SAMPLES: Final = 16  # pixels of each line that are compared first
_MAX_RANGE: Final = 24  # gray levels between them in a bar of one color, noise included
_MAX_BEND: Final = 12  # gray levels: largest second difference of means in a blurred bar

# Bars of one color
_FLAT: Final = 3  # gray levels of deviation in the small frame
_CLEAN: Final = 8  # gray levels of deviation in the full frame, where codecs ring at the edge
_STRAY: Final = 0.02  # share of a line's pixels that may deviate by more
_BLEND: Final = 0.6  # of the contrast of the next line; with less, a line blends bar and content

# Blurred bars
_SMOOTH: Final = 8  # gray levels: largest second difference
_BLOCKY: Final = 0.08  # share of a line that may be less smooth, because of codec blocks
_STEP: Final = 8  # gray levels across the inner edge of a bar
_STRAIGHT: Final = 0.5  # share of the edge that must have the step
_SHARPER: Final = 3.0  # ratio of the detail of the adjacent content to that of the bar
_MIN_BLURRED: Final = 8  # px of the small frame, smallest depth; also with a pattern
_EVEN: Final = 2  # px of the small frame by which opposite bars may differ

# Bars with a pattern
_UNCHANGED: Final = 3  # gray levels by which an unchanged pixel may differ between two frames
_CHANGING: Final = 0.1  # share of the content's outermost lines that must change
_CONFIRMED: Final = 3  # frames in a row with the same bars
_EDGE: Final = 3  # px of the small frame at the inner edge of a bar where pixels may change

_MAX_REST: Final = 15  # frames between two searches for blurred bars and patterns
_PAUSE: Final = 6  # frames between two checks whether such bars are possible

_Gray = NDArray[np.int16]


class Area(NamedTuple):
    """Pixels [left, right) x [top, bottom) of a frame."""

    left: int
    top: int
    right: int
    bottom: int

    def of(self, frame: Image) -> Image:
        """A view of this part of a frame."""
        return frame[self.top : self.bottom, self.left : self.right]


class ContentDetector:
    """Finds the part of the frames of one size that shows the scene.

    Bars of one color and blurred bars are detected in the first frame. Bars with a pattern are
    detected after three frames, because only their lack of motion distinguishes them from the
    scene. When something appears in a bar, that side is content again at once. A new bar at that
    side must then be present for twice as many frames, each time, before it is accepted, so that a
    flat sky has almost no effect. Later in a video, blurred bars and patterns are searched for only
    at intervals.

    Parameters
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.

    Attributes
    ----------
    area : Area
        The content, pixels of the frame.
    uncertain : bool
        Whether bars with a pattern were detected that are not confirmed yet.
    """

    def __init__(self, size_wh: tuple[int, int]) -> None:
        width, height = size_wh
        self._size_wh = size_wh
        self._scale = max(max(size_wh) / _LONGER_SIDE, 1.0)
        self._small_wh = max(round(width / self._scale), 1), max(round(height / self._scale), 1)
        self._bars = tuple(_Bar() for _ in range(4))  # left, top, right, bottom
        self._lines: list[_Gray] = []  # outermost lines of the last frame
        self._small: _Gray | None = None  # last small frame
        self._pattern, self._pattern_frames = [0] * 4, 0  # depths, and frames with them
        self._is_first = True
        self._samples = _outline(size_wh)
        self._rest = self._resting = 0  # frames in which only bars of one color are searched
        self.area = Area(0, 0, width, height)
        self.uncertain = False

    def update(self, frame: Image) -> bool:
        """Process the next frame, (H, W, 3) or (H, W) uint8; returns whether `area` has changed."""
        frame = np.atleast_3d(frame)
        active = any(bar.depth for bar in self._bars)
        rows, columns = self._samples
        samples = frame[rows, columns, _green(frame)]
        has_flat_side = bool((samples.max(axis=1) - samples.min(axis=1)).min() <= _MAX_RANGE)
        self._resting -= 1
        if self._resting > 0 and not active and not has_flat_side:
            self._forget()
            return False
        prev_lines, self._lines = self._lines, [_outermost(frame, side) for side in range(4)]
        plain = [_is_plain(line) for line in self._lines]
        may_have_others = self._resting <= 0 and self._may_have_other_bars(prev_lines)
        if not (active or any(plain) or may_have_others):
            self._resting = max(self._resting, _PAUSE if prev_lines else 0)
            self._small, self._pattern_frames, self.uncertain = None, 0, False
            return False
        compared = self._small is not None
        detected = self._find_bars(frame, plain)
        if detected is None:
            return False
        for bar, depth in zip(self._bars, detected, strict=True):
            bar.update(depth)
        left, top, right, bottom = (bar.depth for bar in self._bars)
        width, height = self._size_wh
        area = Area(left, top, width - right, height - bottom)
        changed, self.area = area != self.area, area
        if compared and not self._pattern_frames and not any(each.depth for each in detected):
            self._rest = min(2 * max(self._rest, _PAUSE // 2) + 1, _MAX_REST)
            self._resting = self._rest
        return changed

    def _forget(self) -> None:
        """Drop the last frame, so that the next one is not compared with it."""
        self._lines, self._small, self._pattern_frames, self.uncertain = [], None, 0, False

    def _may_have_other_bars(self, prev_lines: list[_Gray]) -> bool:
        """Whether two opposite sides may be blurred bars or bars with a pattern."""
        smooth = [_is_smooth(line) for line in self._lines]
        static = [
            bool(np.abs(cur - prev).max() <= _UNCHANGED)
            for cur, prev in zip(self._lines, prev_lines, strict=False)
        ] or [self._is_first] * 4
        self._is_first = False
        return any(all(smooth[axis::2]) or all(static[axis::2]) for axis in range(2))

    def _find_bars(self, frame: Image, plain: list[bool]) -> list[_Depth] | None:
        """Depth of the bar at each side; None if the frame shows no content.

        `plain` says for each side whether its outermost line has one color.
        """
        small = cv2.resize(frame, self._small_wh)
        gray = as_gray(np.asarray(small, dtype=np.uint8)).astype(np.int16)
        prev_gray, self._small = self._small, gray
        if float(gray.std()) < MAX_BLANK_DEVIATION:
            return None
        flat = [_flat_depth(_from_side(gray, side)) if plain[side] else 0 for side in range(4)]
        height, width = gray.shape
        if width - flat[0] - flat[2] < _MIN_CONTENT or height - flat[1] - flat[3] < _MIN_CONTENT:
            return None
        others = self._blurred(gray) if not any(flat[0::2]) or not any(flat[1::2]) else [0] * 4
        if not any(flat) and not any(others):
            others = self._patterned(prev_gray, gray)
        detected = []
        for side, bar in enumerate(self._bars):
            lines = _from_side(frame, side)
            if flat[side]:
                detected.append(_Depth(_flat_edge(lines, flat[side], self._scale), flat[side]))
            elif others[side] and abs(others[side] - bar.small) <= 1:
                detected.append(_Depth(bar.depth, bar.small))
            elif others[side]:
                detected.append(_Depth(_sharp_edge(lines, others[side], self._scale), others[side]))
            else:
                detected.append(_NO_BAR)
        return detected

    def _blurred(self, gray: _Gray) -> list[int]:
        """Depths of blurred bars, px of the small frame."""
        depths, certain = [], []
        for side, bar in enumerate(self._bars):
            depth, straight = _blurred_depth(_from_side(gray, side))
            known = bar.small > 0 and depth >= bar.small - 1
            depths.append(bar.small if known else depth)
            certain.append(known or straight)
        even = [abs(depths[side] - depths[(side + 2) % 4]) <= _EVEN for side in range(4)]
        valid = [certain[side] and certain[(side + 2) % 4] and even[side] for side in range(4)]
        return [depth if ok else 0 for depth, ok in zip(depths, valid, strict=True)]

    def _patterned(self, prev_gray: _Gray | None, gray: _Gray) -> list[int]:
        """Depths of bars with a pattern, px of the small frame; 0 until they are confirmed."""
        if prev_gray is not None:
            changed = np.abs(gray - prev_gray) > _UNCHANGED
            known = [bar.small for bar in self._bars]
            if any(known) and _are_static(changed, known):
                self.uncertain = False
                return known
            depths = _unchanged_depths(changed)
            if depths is not None:
                same = np.abs(np.subtract(depths, self._pattern)).max() <= 1
                self._pattern_frames = (
                    (self._pattern_frames + 1 if same else 1) if any(depths) else 0
                )
                self._pattern = depths
        self.uncertain = self._pattern_frames > 0
        return self._pattern if self._pattern_frames >= _CONFIRMED else [0] * 4


class _Depth(NamedTuple):
    """Depth of the bar at one side in one frame; 0 without a bar."""

    depth: int  # px of the frame
    small: int  # px of the small frame


_NO_BAR: Final = _Depth(0, 0)


class _Bar:
    """The accepted bar at one side."""

    def __init__(self) -> None:
        self.depth, self.small = _NO_BAR
        self._pending, self._frames = 0, 0  # a larger depth, and the frames in a row with it
        self._patience = 1  # frames before a larger depth is accepted

    def update(self, detected: _Depth) -> None:
        """Process the depth that was detected in the next frame."""
        if detected.depth > self.depth:
            self._frames = self._frames + 1 if detected.depth == self._pending else 1
            self._pending = detected.depth
            if self._frames < self._patience:
                return
        elif detected.depth < self.depth:
            self._patience = min(2 * self._patience, _MAX_PATIENCE)
        self._frames = 0
        self.depth, self.small = detected


def _outline(size_wh: tuple[int, int]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns (4, n) of n pixels along each side of a frame."""
    width, height = size_wh
    along_x, along_y = (np.linspace(0, n - 1, _SAMPLES).astype(np.intp) for n in (width, height))
    first, right, bottom = (np.full(_SAMPLES, index) for index in (0, width - 1, height - 1))
    return np.stack([along_y, first, along_y, bottom]), np.stack([first, along_x, right, along_x])


def _outermost(frame: Image, side: int) -> _Gray:
    """Means over bins of 8 pixels of the outermost line of a side, green channel."""
    line = _from_side(frame, side)[:, 0, _green(frame)]
    if len(line) < 3 * _BIN:
        return line.astype(np.int16)
    sums = np.add.reduce(line[: len(line) // _BIN * _BIN].reshape(-1, _BIN), axis=1, dtype=np.int16)
    return np.asarray(sums // _BIN, dtype=np.int16)


def _green(frame: Image) -> int:
    """Index of the channel that is most like the luma: green, or the only one."""
    return int(frame.shape[2]) // 2


def _is_plain(line: _Gray) -> bool:
    ordered = np.sort(line)  # many times as fast as np.median, for a few numbers
    median = (int(ordered[len(line) // 2]) + int(ordered[(len(line) - 1) // 2])) // 2
    return max(int(ordered[-1]) - median, median - int(ordered[0])) <= _FLAT


def _is_smooth(line: _Gray) -> bool:
    return len(line) > 2 and bool(np.abs(line[2:] - 2 * line[1:-1] + line[:-2]).max() <= _MAX_BEND)


def _from_side(frame: NDArray[Any], side: int) -> NDArray[Any]:
    """A view in which the lines along a side are columns, counted from that side.

    Sides are 0 left, 1 top, 2 right, 3 bottom.
    """
    upright = frame.swapaxes(0, 1) if side % 2 else frame
    return upright[:, ::-1] if side >= 2 else upright


def _flat_depth(lines: _Gray) -> int:
    """Number of columns, from the side on, that have one color."""
    color = int(np.median(lines[:, 0]))
    if np.abs(lines[:, 0] - color).max() > _FLAT:
        return 0
    content = np.abs(lines - color).max(axis=0) > _FLAT
    return int(content.argmax()) if content.any() else lines.shape[1]


def _flat_edge(lines: Image, depth: int, scale: float) -> int:
    """The first column of the full frame that shows content, near `depth` of the small one."""
    first = max(int((depth - 2) * scale), 0)
    last = min(int((depth + 3) * scale) + 3, lines.shape[1])
    near = as_gray(np.ascontiguousarray(lines[:, first:last]))
    color = int(np.median(lines[:, 0].mean(axis=-1)))
    deviation = np.abs(near.astype(np.int16) - color)
    edge = int(((deviation > _CLEAN).mean(axis=0) > _STRAY).argmax())
    contrast = deviation.mean(axis=0)
    for _ in range(2):
        if edge + 1 < len(contrast) and contrast[edge] < _BLEND * contrast[edge + 1]:
            edge += 1
    return first + edge


def _blurred_depth(lines: _Gray) -> tuple[int, bool]:
    """Number of smooth columns from the side on, and whether they end at a straight step."""
    middle = lines.shape[1] // 2
    lines = lines[:, : middle + _MIN_BLURRED]
    detail = np.abs(lines[4:] - 2 * lines[2:-2] + lines[:-4])
    smooth = (detail > _SMOOTH).mean(axis=0) <= _BLOCKY
    depth = int((~smooth).argmax())
    if depth < _MIN_BLURRED or depth > middle - _MIN_CONTENT:
        return 0, False
    content, bar = detail[:, depth : depth + _MIN_BLURRED].mean(), detail[:, :depth].mean()
    step = np.abs(lines[:, depth + 1] - lines[:, depth - 2]) >= _STEP
    return depth, float(step.mean()) >= _STRAIGHT and content >= _SHARPER * float(bar)


def _sharp_edge(lines: Image, depth: int, scale: float) -> int:
    """The first column of the full frame after the step near `depth` of the small one."""
    first = max(int((depth - 2) * scale), 0)
    near = lines[:, first : int((depth + 3) * scale) + 3].astype(np.int16)
    steps = np.abs(np.diff(near, axis=1)).mean(axis=(0, 2))
    return first + int(steps.argmax()) + 1


def _unchanged_depths(changed: NDArray[np.bool_]) -> list[int] | None:
    """Depth at each side of the area that did not change (H, W) while the rest did; 0 if none.

    Returns None if almost nothing changed.
    """
    if changed.mean() < _STRAY:
        return None
    depths = []
    for side in range(4):
        lines = _from_side(changed, side).mean(axis=0) > _STRAY
        depths.append(int(lines.argmax()))
    left, top, right, bottom = depths
    inside = changed[top : len(changed) - bottom, left : changed.shape[1] - right]
    for side in range(4):
        opposite = depths[(side + 2) % 4]
        edge = _from_side(inside, side)[:, : 2 * _EVEN].mean()
        if depths[side] < _MIN_BLURRED:
            depths[side] = 0
        elif abs(depths[side] - opposite) > _EVEN or edge < _CHANGING:
            return [0] * 4
    return depths


def _are_static(changed: NDArray[np.bool_], depths: list[int]) -> bool:
    """Whether almost nothing changed (H, W) in bars of these depths, apart from their edges."""
    lines = [_from_side(changed, side)[:, : max(d - _EDGE, 0)] for side, d in enumerate(depths)]
    return all(bar.size == 0 or float(bar.mean()) <= _STRAY for bar in lines)
