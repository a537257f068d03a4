"""Clips in which something covers the target."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import cv2
import numpy as np

from benchmarks.lost.splice import (
    AFTER,
    Floats,
    Splice,
    UnfitError,
    boxes,
    distance,
    meet,
    picture_size,
)
from ssiam.datasets import Sequence
from ssiam.geometry import Image

GROWN = 0.3  # of the target's sides, by which a cover is larger on each side
SLIDE = 6  # frames in which a cover comes or leaves
DRAWS = 200  # places that are tried for a cover's texture


def covered(sequence: Sequence, start: int, length: int, rng: np.random.Generator) -> Splice:
    """The sequence goes on while a piece of its own background hides the target."""
    place = boxes(sequence, start + length + AFTER)
    away = distance(start, length, len(place))
    aside = np.where(away > 0, GROWN + away / SLIDE, 0) * rng.choice((-1, 1))
    aside[:start] *= -1  # it comes from one side and leaves by the other
    covers = place + place[:, [2, 3, 2, 3]] * (-GROWN, -GROWN, 2 * GROWN, 2 * GROWN)
    covers[:, 0] += aside * place[:, 2]
    covers[away > SLIDE] = np.nan
    texture = texture_place(sequence, start - SLIDE, covers, rng)
    truth = np.where((away < SLIDE)[:, None], np.nan, place)
    frames = partial(covered_frames, sequence, covers, texture)
    return Splice("", "", frames, truth, place, (start, start + length))


def texture_place(
    sequence: Sequence, index: int, covers: Floats, rng: np.random.Generator
) -> tuple[int, int, int, int]:
    """Where a piece of the target's size is cut out of a frame, clear of target and cover."""
    box, cover = sequence.box(index), covers[index]
    w, h = (int(side) for side in box[2:])
    room = np.array(picture_size(sequence)) - (w, h)
    for x, y in rng.integers(0, room, (DRAWS, 2)).tolist():
        if not any(meet(np.array(each), (x, y), (w, h)) for each in (box, cover)):
            return x, y, w, h
    raise UnfitError("no background beside the target to cover it with")


def covered_frames(
    sequence: Sequence, covers: Floats, texture: tuple[int, int, int, int]
) -> Iterator[Image]:
    """The frames, with a piece of the first one that has a cover laid over each cover."""
    piece: Image | None = None
    x, y, w, h = texture
    for image, cover in zip(sequence.images(), covers, strict=False):
        if not np.isnan(cover).any():
            if piece is None:
                piece = image[y : y + h, x : x + w].copy()
            lay(piece, image, cover)
        yield image


def lay(piece: Image, image: Image, xywh: Floats) -> None:
    """Paint a texture over a box of the image, as far as the box lies in it."""
    left, top = np.floor(xywh[:2]).astype(int).tolist()
    right, bottom = np.ceil(xywh[:2] + xywh[2:]).astype(int).tolist()
    scaled = cv2.resize(piece, (right - left, bottom - top), interpolation=cv2.INTER_CUBIC)
    inside = image[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    y, x = max(-top, 0), max(-left, 0)
    inside[:] = scaled[y : y + inside.shape[0], x : x + inside.shape[1]]
