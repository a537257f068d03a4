"""`Clip` and `LabelledClip`: an object through the pictures of a video."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ssiam.geometry import XYWH, Image
from ssiam.training.outlines import box_of_mask
from ssiam.training.pictures import label_picture, picture
from ssiam.training.sources import Mask


@dataclass(frozen=True, eq=False)
class _Video:
    """The pictures of a track, one for each frame."""

    folder: Path
    paths: tuple[Path, ...]

    @property
    def shows(self) -> tuple[str, ...]:
        """The folder."""
        return (str(self.folder),)

    @property
    def frames(self) -> int:
        """Number of pictures."""
        return len(self.paths)

    def image(self, t: int) -> Image:
        """The picture of a frame."""
        return picture(self.paths[t])


@dataclass(frozen=True, eq=False)
class Clip(_Video):
    """A track with a box in every picture that shows the target.

    Attributes
    ----------
    folder : Path
        Where the pictures lie, or the first of them if others lie there too.
    paths : tuple of Path
        The pictures.
    boxes : tuple of (float, float, float, float) or None
        For every picture; None where the target is hidden.
    """

    boxes: tuple[XYWH | None, ...]

    def box(self, t: int) -> XYWH | None:
        """The box of a frame."""
        return self.boxes[t]

    def mask(self, t: int) -> Mask | None:
        """None: boxes are all that is told."""
        return None


@dataclass(frozen=True, eq=False)
class LabelledClip(_Video):
    """A track of which every picture has a picture of labels.

    Attributes
    ----------
    folder : Path
        Where the pictures lie.
    paths, labels : tuple of Path
        The pictures, and as many pictures of labels.
    label : int
        That of the object, as `ssiam.training.pictures.label_picture` tells it.
    """

    labels: tuple[Path, ...]
    label: int

    def box(self, t: int) -> XYWH | None:
        """The box around the pixels of that label; None where there are none."""
        return box_of_mask(self.mask(t))

    def mask(self, t: int) -> Mask:
        """The pixels of that label."""
        return np.asarray(label_picture(self.labels[t]) == self.label)
