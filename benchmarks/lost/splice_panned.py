"""Clips whose picture pans away from the target and back."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from benchmarks.lost.splice import (
    AFTER,
    Floats,
    Splice,
    UnfitError,
    boxes,
    distance,
    meet,
    picture_size,
    shifted,
)
from ssiam.datasets import Sequence
from ssiam.geometry import Image

PAN = 10  # frames in which the picture pans away or back
WINDOW = 0.6  # of the raw picture's sides: the picture that pans
MARGIN = 0.05  # of that picture's side, left between it and the target
STEADY = 31  # frames over which the panning picture's path is smoothed


def panned(sequence: Sequence, start: int, length: int, rng: np.random.Generator) -> Splice:
    """The sequence goes on in a part of the picture that pans away from the target and back."""
    raw = boxes(sequence, start + length + AFTER)
    size = np.array(picture_size(sequence))
    window = np.round(WINDOW * size).astype(int)
    part = 1 - np.clip(distance(start, length, len(raw)) / PAN, 0, 1)
    paths = [
        path
        for axis, side in product((0, 1), (-1, 1))
        if is_clean(path := pan(raw, part, window, size, axis, side), raw, part == 0, window, size)
    ]
    if not paths:
        raise UnfitError("the target moves too far to leave it out")
    path = min(paths, key=lambda path: float(beyond(path, window, size).max()))
    place = np.hstack([raw[:, :2] - path, raw[:, 2:]])
    hidden = np.flatnonzero(~meet(place, (0, 0), window))
    inside = ((place[:, :2] >= 0) & (place[:, :2] + place[:, 2:] <= window)).all(axis=1)
    truth = np.where((inside | (part == 0))[:, None], place, np.nan)
    frames = partial(panned_frames, sequence, path, window)
    return Splice("", "", frames, truth, place, (int(hidden[0]), int(hidden[-1]) + 1))


def pan(raw: Floats, part: Floats, window: Floats, size: Floats, axis: int, side: int) -> Floats:
    """Corners (N, 2) of a picture that follows the target, but for `part` (N,) 0..1 goes aside."""
    kernel = np.hanning(STEADY + 2)[1:-1]
    padded = np.pad(raw[:, :2] + raw[:, 2:] / 2, ((STEADY // 2,) * 2, (0, 0)), mode="edge")
    smooth = [np.convolve(each, kernel / kernel.sum(), "valid") for each in padded.T]
    path = np.clip(np.stack(smooth, axis=1) - window / 2, 0, size - window)
    low, high = raw[part == 1, axis], raw[part == 1, axis] + raw[part == 1, axis + 2]
    margin = MARGIN * window[axis]
    aside = high.max() + margin if side > 0 else low.min() - margin - window[axis]
    path[:, axis] += part**2 * (3 - 2 * part) * (aside - path[:, axis])
    return np.round(path)


def is_clean(
    path: Floats, raw: Floats, plain: NDArray[np.bool_], window: Floats, size: Floats
) -> bool:
    """Whether the target is whole in `plain` frames, once away, and its mirror image never seen."""
    low, high = raw[:, :2], raw[:, :2] + raw[:, 2:]
    whole = (path <= np.maximum(low, 0)) & (path + window >= np.minimum(high, size))
    mirror = (path < np.minimum(-low, 0)) | (path + window > np.maximum(2 * size - 2 - high, size))
    hidden = np.flatnonzero(~meet(np.hstack([low - path, raw[:, 2:]]), (0, 0), window))
    once = bool((np.diff(hidden) == 1).all())
    return bool(whole[plain].all()) and not mirror.any() and once


def beyond(path: Floats, window: Floats, size: Floats) -> Floats:
    """Share (N,) of the panning picture that lies outside of the raw one and is mirrored."""
    outside = np.maximum(-path, 0) + np.maximum(path + window - size, 0)
    return np.asarray((outside / window).max(axis=1))


def panned_frames(sequence: Sequence, path: Floats, window: Floats) -> Iterator[Image]:
    """The window of each frame; beyond the raw picture its background is mirrored."""
    for image, corner in zip(sequence.images(), path, strict=False):
        yield shifted(image, -corner, (int(window[0]), int(window[1])))
