"""Clips made from real sequences, with true boxes, in which the target is absent for a while.

There are three kinds: the target is covered, out of the frame, or replaced by a cut to another
sequence. Random choices depend only on the name of the clip, so the clips are the same in every
run.
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

from ssiam.datasets import VideoSequence
from ssiam.geometry import Image

Floats = NDArray[np.float64]
Ints = NDArray[np.int_]

COVER_MARGIN = 0.3  # of a cover on each side, share of the target's side
SLIDE = 6  # frames in which a cover moves in or out
TRIES = 200  # positions that are tried for the texture of a cover

PAN = 10  # frames in which the cropped view pans away or back
CROP = 0.6  # size of the view that pans, share of the frame's sides
PAN_MARGIN = 0.05  # between the view and the target, share of the view's side
SMOOTHING = 31  # frames over which the path of the view is smoothed


@dataclass(frozen=True)
class Timing:
    """When the targets of clips are absent.

    Attributes
    ----------
    starts : tuple of int
        Frames before the target disappears.
    lengths : tuple of int
        Frames of absence.
    after : int
        Frames after the target's return.
    """

    starts: tuple[int, ...] = (40, 80)
    lengths: tuple[int, ...] = (25, 50, 75)  # 1 to 3 s
    after: int = 60


TIMING = Timing()
SHORT_TIMING = Timing((12, 24), (15, 25), 12)  # for sequences of 50 to 100 frames


@dataclass(frozen=True, eq=False)
class AbsenceClip:
    """A clip whose target is fully absent for a while.

    Attributes
    ----------
    name, kind : str
    frames : callable
        Returns a new iterator over the frames.
    truth : (N, 4) float64
        True boxes x, y, w, h in pixels of the clip; nan where the target is not fully visible.
    full_truth : (N, 4) float64
        True boxes, also of the hidden target; nan in a cut.
    absence : (int, int)
        First frame of the absence, and the frame after its last one.
    """

    name: str
    kind: str
    frames: Callable[[], Iterator[Image]]
    truth: Floats
    full_truth: Floats
    absence: tuple[int, int]


class UnsuitableError(Exception):
    """A clip cannot be made from a sequence; the message is the reason."""


def absence_clips(
    sequences: Mapping[str, VideoSequence], shake: float = 0.0, timing: Timing = TIMING
) -> tuple[list[AbsenceClip], dict[str, str]]:
    """All clips that the sequences allow, and the reasons why the others cannot be made, by name.

    `shake` is the standard deviation of an added shift of each frame, share of the width.
    """
    clips, reasons = [], {}
    for each, kind, start, length in product(
        sequences.values(), KINDS, timing.starts, timing.lengths
    ):
        name = f"{each.name} {kind} {start}+{length}"
        rng = np.random.default_rng(zlib.crc32(name.encode()))
        try:
            clip = MAKERS[kind](sequences, each, start, length, timing.after, rng)
        except UnsuitableError as error:
            reasons[name] = str(error)
        else:
            clip = replace(clip, name=name, kind=kind)
            clips.append(_shaken(clip, shake) if shake else clip)
    return clips, reasons


def _covered(
    _: Mapping[str, VideoSequence],
    sequence: VideoSequence,
    start: int,
    length: int,
    after: int,
    rng: np.random.Generator,
) -> AbsenceClip:
    """The sequence with a piece of its background covering the target."""
    boxes = true_boxes(sequence, start + length + after)
    distance = _distance(start, length, len(boxes))
    offset = np.where(distance > 0, COVER_MARGIN + distance / SLIDE, 0) * rng.choice((-1, 1))
    offset[:start] *= -1  # it enters from one side and leaves at the other
    margins = (-COVER_MARGIN, -COVER_MARGIN, 2 * COVER_MARGIN, 2 * COVER_MARGIN)
    covers = boxes + boxes[:, [2, 3, 2, 3]] * margins
    covers[:, 0] += offset * boxes[:, 2]
    covers[distance > SLIDE] = np.nan
    texture = _texture_window(sequence, start - SLIDE, covers, rng)
    truth = np.where((distance < SLIDE)[:, None], np.nan, boxes)
    frames = partial(_covered_frames, sequence, covers, texture)
    return AbsenceClip("", "", frames, truth, boxes, (start, start + length))


def _texture_window(
    sequence: VideoSequence, index: int, covers: Floats, rng: np.random.Generator
) -> tuple[int, int, int, int]:
    """A window x, y, w, h of the target's size in a frame, clear of target and cover."""
    box, cover = sequence.box(index), covers[index]
    w, h = (int(side) for side in box[2:])
    width, height = frame_size(sequence)
    for x, y in rng.integers(0, np.array([width - w, height - h]), (TRIES, 2)).tolist():
        if not any(overlap(np.array(each), (x, y), (w, h)) for each in (box, cover)):
            return x, y, w, h
    raise UnsuitableError("no background next to the target that could cover it")


def _covered_frames(
    sequence: VideoSequence, covers: Floats, texture: tuple[int, int, int, int]
) -> Iterator[Image]:
    """The frames with a texture on each cover, cut out of the first frame that has a cover."""
    piece: Image | None = None
    x, y, w, h = texture
    for image, cover in zip(sequence.images(), covers, strict=False):
        if not np.isnan(cover).any():
            if piece is None:
                piece = image[y : y + h, x : x + w].copy()
            _paint(piece, image, cover)
        yield image


def _paint(piece: Image, image: Image, xywh: Floats) -> None:
    """Paint a texture over the part of a box that is inside of the image."""
    left, top = np.floor(xywh[:2]).astype(int).tolist()
    right, bottom = np.ceil(xywh[:2] + xywh[2:]).astype(int).tolist()
    scaled = cv2.resize(piece, (right - left, bottom - top), interpolation=cv2.INTER_CUBIC)
    inside = image[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    y, x = max(-top, 0), max(-left, 0)
    inside[:] = scaled[y : y + inside.shape[0], x : x + inside.shape[1]]


def _panned(
    _: Mapping[str, VideoSequence],
    sequence: VideoSequence,
    start: int,
    length: int,
    after: int,
    rng: np.random.Generator,
) -> AbsenceClip:
    """A cropped view of the sequence that pans away from the target and back."""
    raw = true_boxes(sequence, start + length + after)
    size = np.array(frame_size(sequence))
    view = np.round(CROP * size).astype(int)
    share = 1 - np.clip(_distance(start, length, len(raw)) / PAN, 0, 1)
    paths = [
        path
        for axis, side in product((0, 1), (-1, 1))
        if _is_clean(path := _pan(raw, share, view, size, axis, side), raw, share == 0, view, size)
    ]
    if not paths:
        raise UnsuitableError("the target moves too far for a view without it")
    path = min(paths, key=lambda path: float(_mirrored_share(path, view, size).max()))
    boxes = np.hstack([raw[:, :2] - path, raw[:, 2:]])
    hidden = np.flatnonzero(~overlap(boxes, (0, 0), view))
    inside = ((boxes[:, :2] >= 0) & (boxes[:, :2] + boxes[:, 2:] <= view)).all(axis=1)
    truth = np.where((inside | (share == 0))[:, None], boxes, np.nan)
    frames = partial(_panned_frames, sequence, path, view)
    return AbsenceClip("", "", frames, truth, boxes, (int(hidden[0]), int(hidden[-1]) + 1))


def _pan(raw: Floats, share: Floats, view: Ints, size: Ints, axis: int, side: int) -> Floats:
    """Corners (N, 2) of a view that follows the target, and by `share` (N,) 0..1 pans aside."""
    kernel = np.hanning(SMOOTHING + 2)[1:-1]
    padded = np.pad(raw[:, :2] + raw[:, 2:] / 2, ((SMOOTHING // 2,) * 2, (0, 0)), mode="edge")
    smooth = [np.convolve(each, kernel / kernel.sum(), "valid") for each in padded.T]
    path = np.clip(np.stack(smooth, axis=1) - view / 2, 0, size - view)
    low, high = raw[share == 1, axis], raw[share == 1, axis] + raw[share == 1, axis + 2]
    margin = PAN_MARGIN * view[axis]
    aside = high.max() + margin if side > 0 else low.min() - margin - view[axis]
    path[:, axis] += share**2 * (3 - 2 * share) * (aside - path[:, axis])
    return np.round(path)


def _is_clean(
    path: Floats, raw: Floats, unpanned: NDArray[np.bool_], view: Ints, size: Ints
) -> bool:
    """Whether the target is whole in unpanned frames and absent once, and its mirror image never.

    The mirror image is that beyond the border of the raw frame.
    """
    low, high = raw[:, :2], raw[:, :2] + raw[:, 2:]
    whole = (path <= np.maximum(low, 0)) & (path + view >= np.minimum(high, size))
    mirror = (path < np.minimum(-low, 0)) | (path + view > np.maximum(2 * size - 2 - high, size))
    hidden = np.flatnonzero(~overlap(np.hstack([low - path, raw[:, 2:]]), (0, 0), view))
    once = bool((np.diff(hidden) == 1).all())
    return bool(whole[unpanned].all()) and not mirror.any() and once


def _mirrored_share(path: Floats, view: Ints, size: Ints) -> Floats:
    """Share (N,) of the view that is outside of the raw frame, and therefore mirrored."""
    outside = np.maximum(-path, 0) + np.maximum(path + view - size, 0)
    return np.asarray((outside / view).max(axis=1))


def _panned_frames(sequence: VideoSequence, path: Floats, view: Ints) -> Iterator[Image]:
    """The view of each frame, mirrored beyond the border of the raw frame."""
    for image, corner in zip(sequence.images(), path, strict=False):
        yield _shifted(image, -corner, (int(view[0]), int(view[1])))


def _cut(
    others: Mapping[str, VideoSequence],
    sequence: VideoSequence,
    start: int,
    length: int,
    after: int,
    rng: np.random.Generator,
) -> AbsenceClip:
    """The sequence with frames of another one inserted."""
    boxes = true_boxes(sequence, start + after)
    long = [each for each in others.values() if each.name != sequence.name and len(each) >= length]
    other = long[rng.integers(len(long))]
    first = int(rng.integers(len(other) - length + 1))
    truth = np.insert(boxes, [start] * length, np.nan, axis=0)
    frames = partial(_cut_frames, sequence, other, start, first, length, after)
    return AbsenceClip("", "", frames, truth, truth.copy(), (start, start + length))


def _cut_frames(
    sequence: VideoSequence, other: VideoSequence, start: int, first: int, length: int, after: int
) -> Iterator[Image]:
    """The sequence with `length` frames of the other one, from `first` on, inserted at `start`."""
    images = sequence.images()
    size = frame_size(sequence)
    inserted = (
        np.asarray(cv2.resize(image, size), np.uint8)
        for image in islice(other.images(first), length)
    )
    return chain(islice(images, start), inserted, islice(images, after))


def _shaken(clip: AbsenceClip, shake: float) -> AbsenceClip:
    """The clip with each frame shifted; see `absence_clips`."""
    rng = np.random.default_rng(zlib.crc32(f"{clip.name} {shake}".encode()))
    height, width = next(clip.frames()).shape[:2]
    shifts = np.round(rng.normal(0, shake * width, (len(clip.truth), 2)))

    def frames() -> Iterator[Image]:
        for image, shift in zip(clip.frames(), shifts, strict=True):
            yield _shifted(image, shift, (width, height))

    moved = np.pad(shifts, ((0, 0), (0, 2)))
    return replace(
        clip, frames=frames, truth=clip.truth + moved, full_truth=clip.full_truth + moved
    )


def _shifted(image: Image, shift: Floats, size_wh: tuple[int, int]) -> Image:
    """The image shifted by whole pixels into one of the given size, mirrored beyond its border."""
    out_from_image = np.column_stack([np.eye(2), shift])
    return np.asarray(
        cv2.warpAffine(
            image,
            out_from_image,
            size_wh,
            flags=cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_REFLECT_101,
        )
    )


def true_boxes(sequence: VideoSequence, count: int) -> Floats:
    """True boxes (count, 4) of the first frames."""
    if len(sequence) < count:
        raise UnsuitableError(f"{len(sequence)} frames, {count} are needed")
    return np.array([sequence.box(index) for index in range(count)])


def _distance(start: int, length: int, count: int) -> Floats:
    """Distance (count,) of each frame from the `length` frames beginning at `start`, in frames."""
    index = np.arange(count)
    return np.maximum(np.maximum(start - index, index - start - length + 1), 0).astype(np.float64)


def frame_size(sequence: VideoSequence) -> tuple[int, int]:
    """Width and height of the frames, pixels."""
    height, width = next(sequence.images()).shape[:2]
    return width, height


def overlap(
    xywh: Floats, corner_xy: tuple[int, int], size_wh: tuple[int, int] | Ints
) -> NDArray[np.bool_]:
    """Whether boxes (..., 4) overlap the box with this corner and size."""
    low, high = xywh[..., :2], xywh[..., :2] + xywh[..., 2:]
    end = np.add(corner_xy, size_wh)
    return np.asarray(((high > corner_xy) & (low < end)).all(axis=-1))


_Maker = Callable[
    [Mapping[str, VideoSequence], VideoSequence, int, int, int, np.random.Generator], AbsenceClip
]
MAKERS: dict[str, _Maker] = {"covered": _covered, "out of the frame": _panned, "cut": _cut}
KINDS = tuple(MAKERS)
