"""`propose_boxes`: objects in a frame that stand out from its background, without a network.

What moves stands out most. The next frames are aligned with the first one by the camera's motion,
and their median shows the background behind whatever has moved away. What hardly moves is found by
its contrast to the surroundings.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import IDENTITY, XYWH, Image, Transform
from ssiam.motion.camera import CameraMotion

FRAMES: Final = 49
"""Frames that are used: two seconds of most videos, in which a walker leaves its own outline."""

MOST: Final = 9
"""Number of proposals at most, so that each has one digit."""

_STEP: Final = 6  # frames between those of which the background is the median
_SIDE: Final = 640  # px, longer side of the images that are compared
_SMOOTHING: Final = 1.0  # px, standard deviation: the alignment is less exact than a pixel
_NOISE: Final = 6.0  # gray levels that are not a difference
# Levels of the ratio of difference and noise: a group of pixels above the first is an object,
# unless it falls apart at a higher one.
_LEVELS: Final = (2.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
_LEAST_PART: Final = 0.2  # of a group's pixels, of each part into which it falls
_LEAST_SIDE: Final = 8  # px of the compared images
_LARGEST_SHARE: Final = 0.25  # of the frame, for objects that are found by contrast
_SURROUNDINGS: Final = 0.06  # of the longer side, standard deviation
_MOST_OVERLAP: Final = 0.3  # of the smaller of two boxes

_Map = NDArray[np.float32]
_Mask = NDArray[np.bool_]
_Span = tuple[int, int, int, int]  # x, y, w, h in the compared images


def propose_boxes(frames: Iterable[Image], static: Image | None = None) -> list[XYWH]:
    """Boxes of objects in the first frame, the most conspicuous first.

    Parameters
    ----------
    frames : iterable of (H, W, 3) uint8 BGR
        The frame, and those after it; the first `FRAMES` are used. With a single one, objects are
        found by contrast alone.
    static : (H, W) uint8, optional
        Not 0 where the frames show what moves with the camera; nothing is proposed there.

    Returns
    -------
    list of (x, y, w, h)
        At most `MOST`, whole pixels of the raw frame; moving objects before others. Empty if
        nothing stands out.
    """
    small_static = None if static is None else _reduced(np.where(static, 255, 0).astype(np.uint8))
    first, *aligned = _aligned(frames, small_static)
    scale = max(first.shape[:2]) / _SIDE
    chosen: list[_Span] = []
    maps = [(_contrast(_reduced(first)), _LARGEST_SHARE)]
    if len(aligned) > 1:
        maps.insert(0, (_difference(_reduced(first), aligned), 1.0))
    for ratio, largest_share in maps:
        if small_static is not None:
            ratio[small_static > 0] = 0
        for span in _objects(ratio):
            is_small = span[2] * span[3] <= largest_share * ratio.size
            if is_small and all(_overlap(span, other) <= _MOST_OVERLAP for other in chosen):
                chosen.append(span)
    factor = max(scale, 1.0)
    return [_scaled(span, factor) for span in chosen[:MOST]]


def _aligned(frames: Iterable[Image], static: Image | None = None) -> list[Any]:
    """The first frame as it is, and every few frames a reduced one, aligned with the first.

    Pixels outside of a frame are NaN. `static` has the size of the reduced frames.
    """
    found: list[Any] = []
    camera = CameraMotion(mask=static)
    cur_from_first: Transform = IDENTITY
    for index, frame in enumerate(islice(frames, FRAMES)):
        small = _reduced(frame)
        motion = camera.update(small)
        if index == 0:
            found.append(frame)
            continue
        if not motion.reliable:
            break
        cur_from_first = motion.cur_from_prev @ cur_from_first
        if index % _STEP == 0:
            found.append(_warped(small, cur_from_first))
    return found


def _reduced(frame: Image) -> Image:
    height, width = frame.shape[:2]
    scale = _SIDE / max(height, width)
    if scale >= 1:
        return frame
    size = max(1, round(width * scale)), max(1, round(height * scale))
    return np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _warped(image: Image, cur_from_first: Transform) -> _Map:
    height, width = image.shape[:2]
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped = cv2.warpAffine(image, cur_from_first[:2], (width, height), flags=flags)
    inside = np.full((height, width), 255, np.uint8)
    coverage = cv2.warpAffine(inside, cur_from_first[:2], (width, height), flags=flags)
    found = np.asarray(warped, dtype=np.float32)
    found[np.asarray(coverage) < 255] = np.nan
    return found


def _difference(image: Image, aligned: Sequence[_Map]) -> _Map:
    """Ratio of the difference from the background and of what noise and edges explain."""
    stack = np.stack(aligned)
    is_known = np.asarray(np.isfinite(stack[..., 0]).any(axis=0), dtype=np.bool_)
    background = image.astype(np.float32)
    background[is_known] = np.nanmedian(stack[:, is_known], axis=0)
    difference = np.abs(_smooth(image.astype(np.float32)) - _smooth(background)).max(axis=2)
    gray = background.mean(axis=2)
    slope = np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1)) / 8
    edges = cv2.dilate(_smooth(slope), np.ones((3, 3), np.uint8))
    return np.asarray(difference / (_NOISE + edges), dtype=np.float32)


def _contrast(image: Image) -> _Map:
    """Ratio of the contrast to the surroundings and of the contrast of most of the image."""
    colors = cv2.cvtColor(image, cv2.COLOR_BGR2LAB).astype(np.float32)
    around = cv2.GaussianBlur(colors, (0, 0), _SURROUNDINGS * max(image.shape[:2]))
    contrast = np.linalg.norm(_smooth(colors) - around, axis=2)
    usual = max(float(np.mean(contrast)), _NOISE)
    return np.asarray(contrast / usual, dtype=np.float32)


def _smooth(values: Any) -> Any:
    return cv2.GaussianBlur(values, (0, 0), _SMOOTHING)


def _objects(ratio: _Map) -> list[_Span]:
    """Boxes of the objects of a map, by the sum of the map inside."""
    masks = [
        part for mask in _groups(ratio > _LEVELS[0], close=True) for part in _parts(ratio, mask, 1)
    ]
    masks.sort(key=lambda mask: -float(ratio[mask].sum()))
    return [_span(mask) for mask in masks]


def _parts(ratio: _Map, mask: _Mask, level: int) -> list[_Mask]:
    """The parts into which a group falls at higher levels; the group itself if it does not."""
    area = np.count_nonzero(mask)
    for index in range(level, len(_LEVELS)):
        parts = [
            part
            for part in _groups(mask & (ratio > _LEVELS[index]), close=False)
            if np.count_nonzero(part) >= _LEAST_PART * area
        ]
        if len(parts) > 1:
            return [each for part in parts for each in _parts(ratio, part, index + 1)]
    return [mask]


def _groups(mask: _Mask, *, close: bool) -> list[_Mask]:
    """Connected pixels, with small gaps closed, or with thin connections cut."""
    # People and vehicles' fronts are higher than wide, and so are the gaps in them.
    size = (5, 7) if close else (3, 3)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, size)
    operation = cv2.MORPH_CLOSE if close else cv2.MORPH_OPEN
    joined = cv2.morphologyEx(mask.astype(np.uint8), operation, kernel)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined)
    large = [
        index
        for index in range(1, count)
        if min(stats[index][cv2.CC_STAT_WIDTH], stats[index][cv2.CC_STAT_HEIGHT]) >= _LEAST_SIDE
    ]
    return [labels == index for index in large]


def _span(mask: _Mask) -> _Span:
    x, y, w, h = cv2.boundingRect(mask.astype(np.uint8))
    return int(x), int(y), int(w), int(h)


def _overlap(a: _Span, b: _Span) -> float:
    """Shared area, of the smaller of the two boxes."""
    w = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    h = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    return max(w, 0) * max(h, 0) / min(a[2] * a[3], b[2] * b[3])


def _scaled(span: _Span, factor: float) -> XYWH:
    x, y, w, h = (float(round(value * factor)) for value in span)
    return x, y, w, h
