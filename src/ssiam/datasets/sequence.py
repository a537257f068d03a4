"""`VideoSequence`: the frames of one clip and the ground truth of its target."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.images import read_deep
from ssiam.errors import SourceError
from ssiam.geometry import XYWH, Image, area_preserving_xywh
from ssiam.video import open_source
from ssiam.video.levels import LEVEL_FRAMES, Levels, find_levels, to_8bit


@dataclass(frozen=True, eq=False)
class VideoSequence:
    """One sequence of a dataset.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
    frames : tuple of Path, or Path
        The image of every frame, in order; or one video file, which has the frames from `first`
        on. Images may be missing if only the ground truth is needed (`ssiam.datasets.pysot`).
    truth : (N, 4) or (N, 8) float64
        Ground truth: x, y, w, h, or the corners x1, y1, ... x4, y4; 0-based pixels, nan if
        unknown. N may be smaller than the number of frames (1 in the test set of GOT-10k).
    tags : mapping of str to (N,) bool
        Frames that have a tag ("camera_motion", "occlusion", ...); an attribute of the whole
        sequence is True in every frame.
    first : int
        Index of the first frame in a video file.
    size_wh : (int, int), optional
        Width and height of the frames, pixels, if the dataset has it.
    count : int, optional
        Number of frames of a video file; by default the number of rows of `truth`.
    others : mapping of str to (N, 4) float64
        Boxes of other objects in the same frames, by the names of their sequences: x, y, w, h,
        nan while an object is not visible. Empty if the dataset has one object per clip.
    """

    name: str
    frames: tuple[Path, ...] | Path
    truth: NDArray[np.float64]
    tags: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    first: int = 0
    size_wh: tuple[int, int] | None = None
    count: int | None = None
    others: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    def __len__(self) -> int:
        if isinstance(self.frames, tuple):
            return len(self.frames)
        return len(self.truth) if self.count is None else self.count

    def images(self, start: int = 0) -> Iterator[Image]:
        """Iterate over the frames (H, W, 3) uint8 BGR from index `start` on.

        Raises
        ------
        SourceError
            A frame cannot be read, or a video is too short; the message names the file.
        StreamError
            A video ended early because it is damaged.
        """
        if isinstance(self.frames, tuple):
            yield from self._read(self.frames, start)
        else:
            yield from self._decoded(self.frames, start)

    def _read(self, paths: tuple[Path, ...], start: int) -> Iterator[Image]:
        """Images from index `start` on; more than 8 bits are scaled by the first frames' levels."""
        levels: Levels | None = None
        for path in paths[start:]:
            image = read_deep(path)
            if image.dtype != np.uint8 and levels is None:
                levels = find_levels(map(read_deep, paths[:LEVEL_FRAMES])) or find_levels([image])
            yield to_8bit(image, levels)

    def _decoded(self, path: Path, start: int) -> Iterator[Image]:
        delivered = start
        with open_source(path) as source:
            for frame in islice(source, self.first + start, self.first + len(self)):
                if source.info.undecoded:
                    # Without this frame, every later box would belong to the wrong frame.
                    raise SourceError(
                        f"{path}: a frame before number {self.first + delivered} (from 0) cannot "
                        "be decoded, so that boxes and frames do not match; get the video again"
                    )
                yield frame.image
                delivered += 1
        if delivered < len(self):
            raise SourceError(
                f"{path}: ends before frame {self.first + len(self) - 1} (from 0), for which "
                "there is a box; check that video and boxes belong together"
            )

    def box(self, index: int) -> XYWH:
        """Upright box x, y, w, h in a frame; for a polygon, the box with its center and area."""
        row = self.truth[index]
        if len(row) == 4:
            x, y, w, h = row.tolist()
            return x, y, w, h
        return area_preserving_xywh(row.reshape(4, 2))

    def other_boxes(self, index: int) -> NDArray[np.float64]:
        """Boxes (K, 4) x, y, w, h of the other objects that are visible in a frame."""
        rows = (boxes[index] for boxes in self.others.values())
        return np.array([row for row in rows if np.isfinite(row).all()]).reshape(-1, 4)


def with_size(sequence: VideoSequence) -> VideoSequence:
    """The sequence with the size of its frames, from the first image if the dataset lacks it.

    Raises
    ------
    SourceError, StreamError
        The first image cannot be read.
    """
    if sequence.size_wh is not None:
        return sequence
    for image in sequence.images():
        return replace(sequence, size_wh=(image.shape[1], image.shape[0]))
    raise SourceError(f"sequence {sequence.name}: has no frames")
