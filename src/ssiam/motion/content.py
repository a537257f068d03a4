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
_LEAST: Final = 8  # px of the small frame: content that is smaller is none
_PATIENCE: Final = 64  # frames, at most, before a depth that was wrong once is believed again

# The outermost lines, in means of 8 pixels: what a bar can look like at all.
_MEANS: Final = 8  # px
_ALONG: Final = 16  # pixels of each line that are looked at first
_NEARLY: Final = 24  # gray levels between them in a bar of one color, noise included
_WAVY: Final = 12  # gray levels: the largest second difference of means in a blurred bar

_FLAT: Final = 3  # gray levels by which a bar of one color differs from it, small frame
_CLEAN: Final = 8  # the same in the full frame, beside the ringing of a codec
_STRAY: Final = 0.02  # share of a line's pixels that may differ by more
_BLEND: Final = 0.6  # of the contrast of the next line: less is a blend of bar and content

_SMOOTH: Final = 8  # gray levels: the largest second difference in a blurred bar
_BLOCKY: Final = 0.08  # share of a line that a codec makes less smooth
_STEP: Final = 8  # gray levels across the edge of a blurred bar
_STRAIGHT: Final = 0.5  # share of the edge of a blurred bar that shows the step
_SHARPER: Final = 3.0  # detail of the content next to it, in that of a blurred bar
_BLURRED: Final = 8  # px of the small frame, the least depth of a blurred bar
_EVEN: Final = 2  # px of the small frame by which opposite bars may differ

_UNCHANGED: Final = 3  # gray levels between two frames
_ALIVE: Final = 0.1  # share of the content's outermost lines that changes
_CONFIRMED: Final = 3  # frames in a row that show the same bars of a pattern

_REST: Final = 15  # frames, at most, between two searches for blurred bars and patterns
_PAUSE: Final = 6  # frames between two looks at whether there may be any

_NOTHING: Final = 2.5  # gray levels, standard deviation of a frame that shows nothing

_DARK: Final = 24  # gray levels of the borders of a stabilized video
_SAME: Final = 2  # gray levels by which such an area may differ from its corner
_NOISE: Final = 0.5  # gray levels, standard deviation in it: a dark scene has more
_RIM: Final = 3  # px around it that its edge reaches through the filters
_AREA: Final = 0.005  # share of the frame that it covers at least
_CONVEX: Final = 0.97  # share of its convex hull that content fills

_Gray = NDArray[np.int16]


class Area(NamedTuple):
    """Pixels [left, right) x [top, bottom) of a frame."""

    left: int
    top: int
    right: int
    bottom: int

    def of(self, frame: Image) -> Image:
        """Return this part of a frame, not copied."""
        return frame[self.top : self.bottom, self.left : self.right]


class Content:
    """Follows which part of the frames of one size shows the scene.

    Bars of one color and blurred ones count from the first frame on; bars with a pattern, which
    only differ from a scene by standing still while the content moves, after three frames. A side
    where something appears in what was taken for a bar gets it back at once, and has to show the
    same bar for longer before it counts again: twice as long each time, so that a flat sky
    costs next to nothing. Later in a video, blurred bars and patterns are only sought now and then.

    Attributes
    ----------
    area : Area
    doubtful : bool
        Whether the content seems to be smaller, by bars with a pattern, but is not sure yet.
    """

    def __init__(self, size_wh: tuple[int, int]) -> None:
        width, height = size_wh
        self._size_wh = size_wh
        self._scale = max(max(size_wh) / _LONGER_SIDE, 1.0)
        self._small_wh = max(round(width / self._scale), 1), max(round(height / self._scale), 1)
        self._bars = tuple(_Bar() for _ in range(4))
        self._lines: list[_Gray] = []  # the outermost ones of the frame before
        self._small: _Gray | None = None  # the small frame before
        self._standing, self._stood = [0] * 4, 0  # bars with a pattern, frames they were seen
        self._first = True
        self._samples = _outline(size_wh)
        self._rest = self._resting = 0  # frames for which only bars of one color are sought
        self.area = Area(0, 0, width, height)
        self.doubtful = False

    def update(self, frame: Image) -> bool:
        """Take the next frame (H, W, 3) uint8; whether `area` is another from now on."""
        active = any(bar.depth for bar in self._bars)
        rows, columns = self._samples
        samples = frame[rows, columns, 1]
        likely = bool((samples.max(axis=1) - samples.min(axis=1)).min() <= _NEARLY)
        self._resting -= 1
        if self._resting > 0 and not active and not likely:
            self._forget()
            return False
        before, self._lines = self._lines, [_outermost(frame, side) for side in range(4)]
        plain = [_plain(line) for line in self._lines]
        others = self._resting <= 0 and self._may_have_others(before)
        if not (active or any(plain) or others):
            self._resting = max(self._resting, _PAUSE if before else 0)
            self._small, self._stood, self.doubtful = None, 0, False
            return False
        compared = self._small is not None
        found = self._found(frame, plain)
        if found is None:
            return False
        for bar, seen in zip(self._bars, found, strict=True):
            bar.see(seen)
        left, top, right, bottom = (bar.depth for bar in self._bars)
        width, height = self._size_wh
        area = Area(left, top, width - right, height - bottom)
        changed, self.area = area != self.area, area
        if compared and not self._stood and not any(seen.depth for seen in found):
            self._rest = min(2 * max(self._rest, _PAUSE // 2) + 1, _REST)
            self._resting = self._rest
        return changed

    def _forget(self) -> None:
        """Compare the next frame with none."""
        self._lines, self._small, self._stood, self.doubtful = [], None, 0, False

    def _may_have_others(self, before: list[_Gray]) -> bool:
        """Whether opposite sides look like blurred bars, or stand still."""
        smooth = [_smooth(line) for line in self._lines]
        still = [
            bool(np.abs(now - past).max() <= _UNCHANGED)
            for now, past in zip(self._lines, before, strict=False)
        ] or [self._first] * 4
        self._first = False
        return any(all(smooth[axis::2]) or all(still[axis::2]) for axis in range(2))

    def _found(self, frame: Image, plain: list[bool]) -> list[_Seen] | None:
        """The bar at each side; None if nothing else is seen."""
        small = cv2.resize(frame, self._small_wh)
        gray = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY).astype(np.int16)
        before, self._small = self._small, gray
        if float(gray.std()) < _NOTHING:
            return None
        flat = [_flat_depth(_from(gray, side)) if plain[side] else 0 for side in range(4)]
        height, width = gray.shape
        if width - flat[0] - flat[2] < _LEAST or height - flat[1] - flat[3] < _LEAST:
            return None
        others = self._blurred(gray) if not any(flat[0::2]) or not any(flat[1::2]) else [0] * 4
        if not any(flat) and not any(others):
            others = self._still(before, gray)
        seen = []
        for side, bar in enumerate(self._bars):
            lines = _from(frame, side)
            if flat[side]:
                seen.append(_Seen(_flat_edge(lines, flat[side], self._scale), flat[side]))
            elif others[side] and abs(others[side] - bar.small) <= 1:
                seen.append(_Seen(bar.depth, bar.small))
            elif others[side]:
                seen.append(_Seen(_sharp_edge(lines, others[side], self._scale), others[side]))
            else:
                seen.append(_NO_BAR)
        return seen

    def _blurred(self, gray: _Gray) -> list[int]:
        """Depths of blurred bars, px of the small frame."""
        depths, sure = [], []
        for side, bar in enumerate(self._bars):
            depth, straight = _blurred_depth(_from(gray, side))
            known = bar.small > 0 and depth >= bar.small - 1
            depths.append(bar.small if known else depth)
            sure.append(known or straight)
        even = [abs(depths[side] - depths[(side + 2) % 4]) <= _EVEN for side in range(4)]
        good = [sure[side] and sure[(side + 2) % 4] and even[side] for side in range(4)]
        return [depth if ok else 0 for depth, ok in zip(depths, good, strict=True)]

    def _still(self, before: _Gray | None, gray: _Gray) -> list[int]:
        """Depths of bars with a pattern, px of the small frame; 0 until they are sure."""
        if before is not None:
            changed = np.abs(gray - before) > _UNCHANGED
            known = [bar.small for bar in self._bars]
            if any(known) and _stand(changed, known):
                self.doubtful = False
                return known
            found = _unchanged_depths(changed)
            if found is not None:
                same = np.abs(np.subtract(found, self._standing)).max() <= 1
                self._stood = (self._stood + 1 if same else 1) if any(found) else 0
                self._standing = found
        self.doubtful = self._stood > 0
        return self._standing if self._stood >= _CONFIRMED else [0] * 4


class _Seen(NamedTuple):
    """A bar at one side, as one frame shows it."""

    depth: int  # px of the frame
    small: int  # px of the small frame


_NO_BAR: Final = _Seen(0, 0)


class _Bar:
    """What counts as the bar at one side, of what was seen of it."""

    def __init__(self) -> None:
        self.depth, self.small = _NO_BAR
        self._pending, self._frames = 0, 0  # another depth, and for how long it was seen
        self._patience = 1  # frames

    def see(self, seen: _Seen) -> None:
        """Take what the next frame shows."""
        if seen.depth > self.depth:
            self._frames = self._frames + 1 if seen.depth == self._pending else 1
            self._pending = seen.depth
            if self._frames < self._patience:
                return
        elif seen.depth < self.depth:
            self._patience = min(2 * self._patience, _PATIENCE)
        self._frames = 0
        self.depth, self.small = seen


def _outline(size_wh: tuple[int, int]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns (4, n) of pixels along the sides of a frame."""
    width, height = size_wh
    along_x, along_y = (np.linspace(0, n - 1, _ALONG).astype(np.intp) for n in (width, height))
    low, right, bottom = (np.full(_ALONG, at) for at in (0, width - 1, height - 1))
    return np.stack([along_y, low, along_y, bottom]), np.stack([low, along_x, right, along_x])


def _outermost(frame: Image, side: int) -> _Gray:
    """Means over 8 pixels of the outermost line of a side, green."""
    line = _from(frame, side)[:, 0, 1]
    if len(line) < 3 * _MEANS:
        return line.astype(np.int16)
    means = line[: len(line) // _MEANS * _MEANS].reshape(-1, _MEANS).mean(axis=1)
    return np.asarray(means, dtype=np.int16)


def _plain(line: _Gray) -> bool:
    return bool(np.abs(line - int(np.median(line))).max() <= _FLAT)


def _smooth(line: _Gray) -> bool:
    return len(line) > 2 and bool(np.abs(np.diff(line, 2)).max() <= _WAVY)


def _from(frame: NDArray[Any], side: int) -> NDArray[Any]:
    """A view in which the lines along a side are columns, counted from that side.

    Sides are 0 left, 1 top, 2 right, 3 bottom.
    """
    turned = frame.swapaxes(0, 1) if side % 2 else frame
    return turned[:, ::-1] if side >= 2 else turned


def _flat_depth(lines: _Gray) -> int:
    """Columns from the side on that have one color."""
    color = int(np.median(lines[:, 0]))
    if np.abs(lines[:, 0] - color).max() > _FLAT:
        return 0
    off = np.abs(lines - color).max(axis=0) > _FLAT
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


def _blurred_depth(lines: _Gray) -> tuple[int, bool]:
    """Columns from the side on that are smooth, and whether they end in a straight step."""
    middle = lines.shape[1] // 2
    lines = lines[:, : middle + _BLURRED]
    detail = np.abs(lines[4:] - 2 * lines[2:-2] + lines[:-4])
    smooth = (detail > _SMOOTH).mean(axis=0) <= _BLOCKY
    depth = int((~smooth).argmax())
    if depth < _BLURRED or depth > middle - _LEAST:
        return 0, False
    inside, outside = detail[:, depth : depth + _BLURRED].mean(), detail[:, :depth].mean()
    step = np.abs(lines[:, depth + 1] - lines[:, depth - 2]) >= _STEP
    return depth, float(step.mean()) >= _STRAIGHT and inside >= _SHARPER * float(outside)


def _sharp_edge(lines: Image, depth: int, scale: float) -> int:
    """The first column of the full frame behind the step next to `depth` of the small one."""
    first = max(int((depth - 2) * scale), 0)
    near = lines[:, first : int((depth + 3) * scale) + 3].astype(np.int16)
    steps = np.abs(np.diff(near, axis=1)).mean(axis=(0, 2))
    return first + int(steps.argmax()) + 1


def _unchanged_depths(changed: NDArray[np.bool_]) -> list[int] | None:
    """Depth at each side of what did not change (H, W) while all else did; none of that is 0.

    None if next to nothing has changed.
    """
    if changed.mean() < _STRAY:
        return None
    depths = []
    for side in range(4):
        lines = _from(changed, side).mean(axis=0) > _STRAY
        depths.append(int(lines.argmax()))
    left, top, right, bottom = depths
    inside = changed[top : len(changed) - bottom, left : changed.shape[1] - right]
    for side in range(4):
        opposite = depths[(side + 2) % 4]
        edge = _from(inside, side)[:, : 2 * _EVEN].mean()
        if depths[side] < _BLURRED:
            depths[side] = 0
        elif abs(depths[side] - opposite) > _EVEN or edge < _ALIVE:
            return [0] * 4
    return depths


def _stand(changed: NDArray[np.bool_], depths: list[int]) -> bool:
    """Whether next to nothing has changed (H, W) in bars of these depths, their edges aside."""
    lines = [_from(changed, side)[:, : max(d - _RIM, 0)] for side, d in enumerate(depths)]
    return all(bar.size == 0 or float(bar.mean()) <= _STRAY for bar in lines)


def flat_outside(gray: Image) -> Image | None:
    """What is of one color from the corners on, around convex content: 255 there and 0 elsewhere.

    It is what a bar is not: a disc's outside, the borders of a stabilized video. `gray` is a
    small frame (H, W) uint8; None where there is nothing of the kind.
    """
    height, width = gray.shape
    corners = [(x, y) for x in (0, width - 1) for y in (0, height - 1)]
    levels = [int(gray[y, x]) for x, y in corners]
    alike = sum(abs(level - sorted(levels)[1]) <= _SAME for level in levels) >= 3
    seeds = [c for c, level in zip(corners, levels, strict=True) if level <= _DARK or alike]
    if not seeds:
        return None
    filled = np.zeros((height + 2, width + 2), np.uint8)
    flags = 4 | (255 << 8) | cv2.FLOODFILL_MASK_ONLY | cv2.FLOODFILL_FIXED_RANGE
    outside = filled[1:-1, 1:-1]
    for x, y in seeds:
        if not outside[y, x]:
            cv2.floodFill(gray, filled, (x, y), 0, _SAME, _SAME, flags)
    if not _AREA * gray.size <= cv2.countNonZero(outside) <= (1 - _AREA) * gray.size:
        return None
    if float(cv2.meanStdDev(gray, mask=outside)[1].max()) > _NOISE:
        return None
    inside = cv2.bitwise_not(outside)
    outlines, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = cv2.convexHull(np.concatenate(outlines))
    shape = np.zeros_like(inside)
    cv2.fillConvexPoly(shape, hull, 255)
    return outside if cv2.countNonZero(inside) >= _CONVEX * cv2.countNonZero(shape) else None


def shows_nothing(gray: Image) -> bool:
    """Whether a frame (H, W) uint8 is of one color but for noise."""
    return float(cv2.meanStdDev(gray)[1].max()) < _NOTHING


def without_rim(outside: Image) -> Image:
    """255 where neither an area of `flat_outside` nor its edge is, else 0; (H, W) uint8."""
    reach = np.ones((2 * _RIM + 1, 2 * _RIM + 1), np.uint8)
    return np.asarray(cv2.bitwise_not(cv2.dilate(outside, reach)), dtype=np.uint8)
