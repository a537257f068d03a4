"""A spliced clip, and what its makers share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import Sequence
from ssiam.geometry import Image

Floats = NDArray[np.float64]

AFTER = 60  # frames after the target's return


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
