"""Clips whose target is away for 3 to 30 s, and comes back.

A short sequence is played forward and backward until it is long enough. There are five kinds:
covered, out of the frame, and cut as in benchmarks/lost/clips.py; a pan of up to three widths away
and back, past still pictures of other sequences; and a cover with another object of the same kind
in sight meanwhile, and for a while after the target's return. Every combination of sequence and
kind has one length, which depends only on their order.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import count

import cv2
import numpy as np

from benchmarks.lost.clips import (
    MAKERS,
    AbsenceClip,
    Floats,
    UnsuitableError,
    frame_size,
    overlap,
    true_boxes,
)
from ssiam.datasets import VideoSequence
from ssiam.geometry import Image

LENGTHS = (75, 150, 75, 300, 75, 750)  # frames: 3 to 30 s at 25 frames a second
START, AFTER = 60, 80  # frames before and after
PAN_SPEED = 0.04  # widths per frame, at most
MIN_PAN = 98  # frames of a pan of 1.3 widths and back
MAX_WIDTHS = 3  # of a pan
BLEND = 0.1  # share of the width over which pictures blend into each other
EDGE = 0.15  # share of a pasted object's sides over which it fades out
IN_SIGHT_AFTER = 40  # frames after the target's return in which the look-alike is in sight
KINDS = ("covered", "out of the frame", "cut", "pan", "look-alike")
# Sequences whose targets are of one kind, by the first letters of their names.
OF_A_KIND = (
    ("Girl", "FaceOcc1", "Freeman1"),
    ("Car1", "Suv", "RedTeam", "car-", "drift-"),
    ("Dog1", "Dog", "dog", "libby"),
    ("ADL-",),
)


def prolonged(sequence: VideoSequence, length: int) -> VideoSequence:
    """A sequence of images played forward and backward, `length` frames in all."""
    assert isinstance(sequence.frames, tuple)
    last = len(sequence) - 1
    phase = np.arange(length) % (2 * last)
    order = np.minimum(phase, 2 * last - phase)
    return replace(
        sequence,
        frames=tuple(sequence.frames[index] for index in order.tolist()),
        truth=sequence.truth[order],
        tags={},
        others={},
    )


def away_clips(
    sequences: Mapping[str, VideoSequence], kinds: Sequence[str] = KINDS
) -> tuple[list[AbsenceClip], dict[str, str]]:
    """One clip for each sequence and kind, and the reasons why others cannot be made, by name."""
    clips, reasons, turn = [], {}, count()
    for sequence in sequences.values():
        for kind in KINDS:
            length = LENGTHS[next(turn) % len(LENGTHS)]
            if kind not in kinds:
                continue
            name = f"{sequence.name} {kind} {length}"
            rng = np.random.default_rng(zlib.crc32(name.encode()))
            try:
                clip = _made(kind, sequences, sequence, length, rng)
            except UnsuitableError as error:
                reasons[name] = str(error)
            else:
                clips.append(replace(clip, name=name, kind=kind))
    return clips, reasons


def _made(
    kind: str,
    sequences: Mapping[str, VideoSequence],
    sequence: VideoSequence,
    length: int,
    rng: np.random.Generator,
) -> AbsenceClip:
    total = START + max(length, MIN_PAN) + AFTER
    long = {name: prolonged(each, total) for name, each in sequences.items()}
    own = long[sequence.name]
    if kind in MAKERS:
        return MAKERS[kind](long, own, START, length, AFTER, rng)
    if kind == "pan":
        return _pan(own, [each for each in long.values() if each is not own], length, rng)
    return _look_alike(own, list(long.values()), length, rng)


def _pan(
    own: VideoSequence, others: list[VideoSequence], length: int, rng: np.random.Generator
) -> AbsenceClip:
    """A pan past still pictures, and back."""
    widths = float(np.clip(PAN_SPEED * length / 3, 1.3, MAX_WIDTHS))
    ramp = int(np.ceil(1.5 * widths / PAN_SPEED))
    length = max(length, 2 * ramp)
    boxes = true_boxes(own, START + length + AFTER)
    width, height = frame_size(own)
    stills = [next(others[index].images()) for index in rng.choice(len(others), MAX_WIDTHS)]
    stills = [np.asarray(cv2.resize(each, (width, height)), np.uint8) for each in stills]
    index = np.arange(len(boxes))
    share = np.clip(np.minimum(index - START, START + length - index) / ramp, 0, 1)
    x = np.round(share**2 * (3 - 2 * share) * widths * width)
    sign = int(rng.choice((-1, 1)))
    moved = boxes - sign * np.pad(x[:, None], ((0, 0), (0, 3)))
    hidden = np.flatnonzero(~overlap(moved, (0, 0), (width, height)))
    inside = (moved[:, 0] >= 0) & (moved[:, 0] + moved[:, 2] <= width)
    truth = np.where((inside | (x == 0))[:, None], moved, np.nan)
    frames = partial(_pan_frames, own, stills, x.astype(int), sign)
    return AbsenceClip("", "", frames, truth, moved, (int(hidden[0]), int(hidden[-1]) + 1))


def _pan_frames(own: VideoSequence, stills: list[Image], x: Floats, sign: int) -> Iterator[Image]:
    for image, left in zip(own.images(), x.tolist(), strict=False):
        if not left:
            yield image
            continue
        width = image.shape[1]
        pictures = [image, *stills, stills[-1]]
        wide = np.hstack([each if sign > 0 else each[:, ::-1] for each in pictures])
        if sign < 0:
            wide = np.hstack([each for each in pictures[::-1]])
            left = wide.shape[1] - width - left
        _blend(wide, width)
        yield wide[:, left : left + width].copy()


def _blend(wide: Image, width: int) -> None:
    """Blend pictures of a width, side by side, into each other."""
    reach = int(BLEND * width)
    weight = np.linspace(0, 0.5, reach)[:, None]
    for seam in range(width, wide.shape[1], width):
        left, right = wide[:, seam - reach : seam].copy(), wide[:, seam : seam + reach].copy()
        wide[:, seam - reach : seam] = left * (1 - weight) + right[:, ::-1] * weight
        wide[:, seam : seam + reach] = right * (1 - weight[::-1]) + left[:, ::-1] * weight[::-1]


def _look_alike(
    own: VideoSequence, others: list[VideoSequence], length: int, rng: np.random.Generator
) -> AbsenceClip:
    """The covered clip with another object of the kind in sight."""
    clip = MAKERS["covered"]({}, own, START, length, AFTER, rng)
    picture = _other_object(own, others, rng)
    width, height = frame_size(own)
    first, end = clip.absence
    time = np.arange(end + IN_SIGHT_AFTER - first)
    phase = rng.uniform(0, 6, 2)
    path = np.stack(
        [
            width * (0.5 + 0.38 * np.sin(time / 60 + phase[0])),
            height * (0.5 + 0.3 * np.sin(time / 47 + phase[1])),
        ],
        axis=1,
    )
    frames = partial(_look_alike_frames, clip, picture, path)
    return replace(clip, frames=frames)


def _other_object(
    own: VideoSequence, others: list[VideoSequence], rng: np.random.Generator
) -> Image:
    """The picture of another object of the kind, or a mirrored and recolored copy of the target."""
    kind = next((names for names in OF_A_KIND if own.name.startswith(names)), ())
    alike = [each for each in others if each.name != own.name and each.name.startswith(kind)]
    if kind and alike:
        source = alike[int(rng.integers(len(alike)))]
        return _cut_out(source, 0)
    picture = _cut_out(own, 0)[:, ::-1]
    hsv = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_BGR2HSV)
    hsv[..., 0] = (hsv[..., 0].astype(int) + 20) % 180
    hsv[..., 1] = (hsv[..., 1] * 0.8).astype(np.uint8)
    return np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR), np.uint8)


def _cut_out(sequence: VideoSequence, index: int) -> Image:
    image = next(sequence.images(index))
    x, y, w, h = np.round(sequence.box(index)).astype(int).tolist()
    return image[max(y, 0) : y + h, max(x, 0) : x + w].copy()


def _look_alike_frames(clip: AbsenceClip, picture: Image, path: Floats) -> Iterator[Image]:
    first, _ = clip.absence
    for index, image in enumerate(clip.frames()):
        step = index - first
        if 0 <= step < len(path):
            box = clip.full_truth[index]
            if not _is_near(path[step], box):
                _paste(picture, image, path[step], box[2:])
        yield image


def _is_near(center: Floats, box: Floats) -> bool:
    """Whether an object at this center would overlap the target."""
    return bool((np.abs(center - box[:2] - box[2:] / 2) < 1.4 * box[2:]).all())


def _paste(picture: Image, image: Image, center: Floats, size: Floats) -> None:
    """Paste a picture, faded out at its edges, over a part of the image."""
    w, h = np.maximum(np.round(size), 4).astype(int).tolist()
    scaled = cv2.resize(picture, (w, h), interpolation=cv2.INTER_AREA)
    fade = [
        np.clip(np.minimum(np.arange(n) + 0.5, n - np.arange(n) - 0.5) / (EDGE * n), 0, 1)
        for n in (h, w)
    ]
    mask = np.outer(*fade)[..., None]
    x, y = np.round(center - (w / 2, h / 2)).astype(int).tolist()
    left, top = max(-x, 0), max(-y, 0)
    part = image[max(y, 0) : max(y + h, 0), max(x, 0) : max(x + w, 0)]
    rows, columns = part.shape[:2]
    own = slice(top, top + rows), slice(left, left + columns)
    part[:] = np.rint(scaled[own] * mask[own] + part * (1 - mask[own])).astype(np.uint8)
