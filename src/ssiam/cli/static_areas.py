"""`StaticAreas`: the areas of ``--static-area``, which move with the camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, TypeAlias

import numpy as np
from cyclopts import Parameter

from ssiam.cli.options import STABILIZATION_GROUP
from ssiam.errors import ArgumentError, SourceError
from ssiam.geometry import XYWH, Image, Mask
from ssiam.outputs import NamedPath
from ssiam.video.images import UnreadableImage, read_pages

StaticAreaOption: TypeAlias = Annotated[
    list[str] | None,
    Parameter(group=STABILIZATION_GROUP, negative=(), allow_leading_hyphen=True),
]

_FILE_MARK: Final = "@"
_FORMS: Final = "give x,y,width,height in pixels, such as 0,600,1280,120, or @FILE with an image"


@dataclass(frozen=True, eq=False)
class StaticAreas:
    """Areas that move with the camera, such as your vehicle or a display.

    Attributes
    ----------
    boxes : sequence of (x, y, w, h)
        Raw-frame pixels.
    images : sequence of (path, (H, W) bool)
        True where the frames are static.
    """

    boxes: Sequence[XYWH] = ()
    images: Sequence[tuple[Path, Mask]] = ()

    def __bool__(self) -> bool:
        return bool(self.boxes or self.images)

    @classmethod
    def parse(cls, texts: Sequence[str] | None) -> StaticAreas:
        """The areas of all ``--static-area`` options; images are read.

        Raises
        ------
        ArgumentError
            A text is neither ``x,y,w,h`` nor ``@FILE``, or a file is not an image.
        SourceError
            An image is too large.
        """
        given = texts or ()
        boxes = [_parse_box(text) for text in given if not text.startswith(_FILE_MARK)]
        return cls(boxes, [(path, _read_mask(path)) for _, path in static_area_files(given)])

    def mask(self, size_wh: tuple[int, int]) -> Image | None:
        """The mask (H, W) of frames of (width, height), 255 where static; None without areas.

        Raises
        ------
        ArgumentError
            A box is outside of the frame, an image has another size, or nothing is left.
        """
        if not self:
            return None
        width, height = size_wh
        mask = np.zeros((height, width), np.uint8)
        for x, y, w, h in self.boxes:
            left, top = max(math.floor(x), 0), max(math.floor(y), 0)
            inside = mask[top : max(math.ceil(y + h), 0), left : max(math.ceil(x + w), 0)]
            if not inside.size:
                raise ArgumentError(
                    f"--static-area {x:g},{y:g},{w:g},{h:g} is outside of the frame of "
                    f"{width}x{height} pixels"
                )
            inside[:] = 255
        for path, static in self.images:
            if static.shape != mask.shape:
                raise ArgumentError(
                    f"--static-area {_FILE_MARK}{path}: has {static.shape[1]}x{static.shape[0]} "
                    f"pixels: give an image of {width}x{height}, as the frames have"
                )
            mask[static] = 255
        if mask.all():
            raise ArgumentError(
                "--static-area covers the whole frame: leave out only what moves with the camera"
            )
        return mask

    def check(self, size_wh: tuple[int, int]) -> None:
        """Raise as `mask` for frames of (width, height)."""
        self.mask(size_wh)


NO_STATIC_AREAS: Final = StaticAreas()


def static_area_files(texts: Sequence[str] | None) -> list[NamedPath]:
    """The images that ``--static-area`` reads, to check that no output is one of them."""
    return [
        ("--static-area", Path(text.removeprefix(_FILE_MARK)))
        for text in texts or ()
        if text.startswith(_FILE_MARK)
    ]


def _parse_box(text: str) -> XYWH:
    try:
        x, y, w, h = (float(number) for number in text.split(","))
    except ValueError:
        raise ArgumentError(f"--static-area {text[:80]!r} is not an area: {_FORMS}") from None
    if not all(map(math.isfinite, (x, y, x + w, y + h))) or w <= 0 or h <= 0:
        raise ArgumentError(f"--static-area {text[:80]!r} is empty or not finite: {_FORMS}")
    return x, y, w, h


def _read_mask(path: Path) -> Mask:
    """The pixels (H, W) of an image file that are not 0 in all channels."""
    try:
        _, image = next(read_pages(path))
    except UnreadableImage:
        raise ArgumentError(
            f"--static-area {_FILE_MARK}{path}: is not an image that can be read: give one that "
            "is not 0 where the frames are static"
        ) from None
    except SourceError as error:
        raise ArgumentError(f"--static-area {_FILE_MARK}{error}") from None
    return np.asarray(image.any(axis=2) if image.ndim == 3 else image != 0)
