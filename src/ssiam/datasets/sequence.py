"""`Sequence`: the frames of one clip and where its target truly is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import SourceError
from ssiam.geometry import XYWH, Image, area_preserving_xywh
from ssiam.video import open_source


@dataclass(frozen=True, eq=False)
class Sequence:
    """One sequence of a dataset, as its reader found it on disk.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
    frames : tuple of Path, or Path
        The image of every frame, in order; or one video file, whose frames from `first` on are
        the sequence's. Images may be absent where only the truth was got (`ssiam.datasets.pysot`).
    truth : (N, 4) or (N, 8) float64
        Where the target is: x, y, w, h, or the corners x1, y1, ... x4, y4; 0-based pixels, nan
        where it is not told. N may be smaller than the number of frames (GOT-10k tells one).
    tags : mapping of str to (N,) bool
        Frames that carry a tag ("camera_motion", "occlusion", ...); an attribute of the whole
        sequence is true in every frame.
    first : int
        Index of the first frame in a video file.
    size_wh : (int, int), optional
        Width and height of the frames, pixels, where the dataset tells it.
    count : int, optional
        Number of frames of a video file; None: as many as there are rows in `truth`.
    """

    name: str
    frames: tuple[Path, ...] | Path
    truth: NDArray[np.float64]
    tags: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    first: int = 0
    size_wh: tuple[int, int] | None = None
    count: int | None = None

    def __len__(self) -> int:
        if isinstance(self.frames, tuple):
            return len(self.frames)
        return len(self.truth) if self.count is None else self.count

    def images(self, start: int = 0) -> Iterator[Image]:
        """The frames (H, W, 3) uint8 BGR from index `start` on, one after another.

        Raises
        ------
        SourceError
            A frame cannot be read, or a video ends too early; the message names the file.
        StreamError
            A video broke off.
        """
        if isinstance(self.frames, tuple):
            yield from map(read_image, self.frames[start:])
        else:
            yield from self._decoded(self.frames, start)

    def _decoded(self, path: Path, start: int) -> Iterator[Image]:
        delivered = start
        with open_source(path) as source:
            for frame in islice(source, self.first + start, self.first + len(self)):
                yield frame.image
                delivered += 1
        if delivered < len(self):
            raise SourceError(
                f"{path}: ends before frame {self.first + len(self) - 1} (from 0), for which "
                "there is a box; is it the video that the boxes were drawn on?"
            )

    def box(self, index: int) -> XYWH:
        """Upright box of the target in a frame; of a polygon, the one of its centre and area."""
        row = self.truth[index]
        if len(row) == 4:
            x, y, w, h = row.tolist()
            return x, y, w, h
        return area_preserving_xywh(row.reshape(4, 2))


def read_image(path: Path) -> Image:
    """An image file as (H, W, 3) uint8 BGR; `SourceError` if it is none."""
    # Not `cv2.imread`, which fails on non-Latin paths under Windows.
    try:
        encoded = np.fromfile(path, dtype=np.uint8)
        image = cv2.imdecode(encoded, cv2.IMREAD_COLOR) if encoded.size else None
    except FileNotFoundError:
        raise SourceError(f"{path}: does not exist; get the frames of the dataset") from None
    except (OSError, cv2.error):
        image = None
    if image is None:
        raise SourceError(f"{path}: is not an image that can be read; get it again")
    return np.asarray(image, dtype=np.uint8)
