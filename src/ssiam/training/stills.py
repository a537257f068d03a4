"""`OnePicture`, and `Still`: an object in a single picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ssiam.geometry import XYWH, Image
from ssiam.training.outlines import Outline, box_of_mask, box_of_shares
from ssiam.training.pictures import picture, size_of
from ssiam.training.sources import Mask


@dataclass(frozen=True, eq=False, slots=True)
class OnePicture:
    """A track of one frame."""

    path: Path

    @property
    def frames(self) -> int:
        """One."""
        return 1

    @property
    def shows(self) -> tuple[str, ...]:
        """The picture's path."""
        return (str(self.path),)

    def image(self, t: int) -> Image:
        """The picture."""
        return picture(self.path)


@dataclass(frozen=True, eq=False, slots=True)
class Still(OnePicture):
    """A track of one frame.

    Attributes
    ----------
    path : Path
        The picture.
    xywh : (float, float, float, float), optional
        Box of the object, pixels; None: that of its outline.
    outline : Outline, optional
    as_shares : bool
        `xywh` is the centre's x and y, width and height as shares of the picture's.
    """

    xywh: XYWH | None = None
    outline: Outline | None = None
    as_shares: bool = False

    def box(self, t: int) -> XYWH | None:
        """The object's box; None if its outline is empty."""
        if self.xywh is None:
            mask = self.mask(t)
            return None if mask is None else box_of_mask(mask)
        return box_of_shares(self.xywh, size_of(self.image(t))) if self.as_shares else self.xywh

    def mask(self, t: int) -> Mask | None:
        """The outline filled, if there is one."""
        return None if self.outline is None else self.outline.mask(size_of(self.image(t)))
