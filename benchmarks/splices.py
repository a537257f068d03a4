"""Real sequences spliced so that the target is gone for a while, and where it truly is.

Three kinds: it is covered, the picture pans away from it, or there is a cut to elsewhere and back.
What is drawn at random hangs on the clip's name alone, so the same clips come out every time.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice, product

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import Sequence
from ssiam.geometry import Image

Floats = NDArray[np.float64]

KINDS = ("covered", "out of the frame", "cut")
STARTS = (40, 80)  # frames of plain tracking before the target goes
LENGTHS = (25, 50, 75)  # frames that it is gone, 1 to 3 s
AFTER = 60  # frames after its return
GROWN = 0.3  # of the target's sides, by which a cover is larger on each side
SLIDE = 6  # frames in which a cover comes or leaves
PAN = 10  # frames in which the picture pans away or back
WINDOW = 0.6  # of the raw picture's sides: the picture that pans
MARGIN = 0.05  # of that picture's side, left between it and the target
STEADY = 31  # frames over which the panning picture's path is smoothed
DRAWS = 200  # places that are tried for a cover's texture


@dataclass(frozen=True, eq=False)
class Splice:
    """A clip whose target is wholly gone in the frames `gone` = (first, end).

    `frames` makes the frames anew. `truth` (N, 4) is the box, nan where the target is not wholly
    seen; `place` (N, 4) is where it is, hidden or not, nan where it is nowhere (in a cut). Both
    are x, y, w, h in pixels of the clip.
    """

    name: str
    kind: str
    frames: Callable[[], Iterator[Image]]
    truth: Floats
    place: Floats
    gone: tuple[int, int]


class UnfitError(Exception):
    """Says why a clip cannot be made of a sequence."""


def splices(
    sequences: Mapping[str, Sequence], shake: float = 0.0
) -> tuple[list[Splice], dict[str, str]]:
    """All clips that the sequences allow, and by their names why the others do not exist.

    `shake` is the standard deviation of each frame's shift, as a share of the width.
    """
    makers = dict(zip(KINDS, (covered, panned, partial(cut, sequences)), strict=True))
    clips, unfit = [], {}
    for each, kind, start, length in product(sequences.values(), makers, STARTS, LENGTHS):
        name = f"{each.name} {kind} {start}+{length}"
        try:
            clip = makers[kind](
                each, start, length, np.random.default_rng(zlib.crc32(name.encode()))
            )
        except UnfitError as error:
            unfit[name] = str(error)
        else:
            clip = replace(clip, name=name, kind=kind)
            clips.append(shaken(clip, shake) if shake else clip)
    return clips, unfit


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


def cut(
    others: Mapping[str, Sequence],
    sequence: Sequence,
    start: int,
    length: int,
    rng: np.random.Generator,
) -> Splice:
    """The sequence stands still while frames of another one are shown."""
    plain = boxes(sequence, start + AFTER)
    fit = [each for each in others.values() if each.name != sequence.name and len(each) >= length]
    other = fit[rng.integers(len(fit))]
    first = int(rng.integers(len(other) - length + 1))
    truth = np.insert(plain, [start] * length, np.nan, axis=0)
    frames = partial(cut_frames, sequence, other, start, first, length)
    return Splice("", "", frames, truth, truth.copy(), (start, start + length))


def cut_frames(
    sequence: Sequence, other: Sequence, start: int, first: int, length: int
) -> Iterator[Image]:
    """The sequence with `length` frames of the other one, from `first` on, put in at `start`."""
    images = sequence.images()
    size = picture_size(sequence)
    elsewhere = (cv2.resize(image, size) for image in islice(other.images(first), length))
    return chain(islice(images, start), elsewhere, islice(images, AFTER))


def shaken(clip: Splice, shake: float) -> Splice:
    """The clip with every frame shifted by itself; see `splices`."""
    rng = np.random.default_rng(zlib.crc32(f"{clip.name} {shake}".encode()))
    height, width = next(clip.frames()).shape[:2]
    shifts = np.round(rng.normal(0, shake * width, (len(clip.truth), 2)))

    def frames() -> Iterator[Image]:
        for image, shift in zip(clip.frames(), shifts, strict=True):
            yield shifted(image, shift, (width, height))

    moved = np.pad(shifts, ((0, 0), (0, 2)))
    return replace(clip, frames=frames, truth=clip.truth + moved, place=clip.place + moved)


def shifted(image: Image, shift: Floats, size_wh: tuple[int, int]) -> Image:
    """The image moved by whole pixels into a picture of that size, mirrored beyond its border."""
    pose = np.column_stack([np.eye(2), shift])
    return np.asarray(
        cv2.warpAffine(
            image, pose, size_wh, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REFLECT_101
        )
    )


def boxes(sequence: Sequence, count: int) -> Floats:
    """The first `count` true boxes (count, 4)."""
    if len(sequence) < count:
        raise UnfitError(f"{len(sequence)} frames, {count} are needed")
    return np.array([sequence.box(index) for index in range(count)])


def distance(start: int, length: int, count: int) -> Floats:
    """How many frames each of `count` is from the `length` ones that begin at `start`."""
    index = np.arange(count)
    return np.maximum(np.maximum(start - index, index - start - length + 1), 0).astype(np.float64)


def picture_size(sequence: Sequence) -> tuple[int, int]:
    """Width and height of the frames."""
    height, width = next(sequence.images()).shape[:2]
    return width, height


def meet(xywh: Floats, corner_xy: tuple[int, int], size_wh: object) -> NDArray[np.bool_]:
    """Whether boxes (..., 4) share anything with the box of that corner and size."""
    low, high = xywh[..., :2], xywh[..., :2] + xywh[..., 2:]
    return np.asarray(((high > corner_xy) & (low < np.add(corner_xy, size_wh))).all(axis=-1))
