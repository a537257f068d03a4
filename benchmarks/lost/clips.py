"""Real sequences spliced so that the target is gone for a while, and where it truly is.

Three kinds: it is covered, the picture pans away from it, or there is a cut to elsewhere and back.
What is drawn at random hangs on the clip's name alone, so the same clips come out every time.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import chain, islice, product

import cv2
import numpy as np

from benchmarks.lost.splice import AFTER, Splice, UnfitError, boxes, picture_size, shifted
from benchmarks.lost.splice_covered import covered
from benchmarks.lost.splice_panned import panned
from ssiam.datasets import Sequence
from ssiam.geometry import Image

KINDS = ("covered", "out of the frame", "cut")
STARTS = (40, 80)  # frames of plain tracking before the target goes
LENGTHS = (25, 50, 75)  # frames that it is gone, 1 to 3 s


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
