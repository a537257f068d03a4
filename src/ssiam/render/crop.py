"""`Crop`: how much of the raw frame's width and height a virtual camera gives up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import Transform, frame_center

# Largest share of width and height that is cropped by itself: with more, handheld clips in trials
# gained little stillness and lost visible resolution.
_MAX_AUTO: Final = 0.15
# Share that the image may move out of view if nothing is cropped.
_MAX_UNCROPPED: Final = 0.30
_MAX_FIXED: Final = 0.80  # more leaves a fifth of the width
_COVERED: Final = 0.99  # share of the frames whose border an automatic crop hides


@dataclass(frozen=True)
class Crop:
    """How the border is hidden that appears where the image is moved.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    share : float or None
        Share of width and of height that is cut away, 0 to 0.8; the rest is enlarged to the size
        of the frame. None chooses the smallest share that hides the border in 99 % of the frames,
        at most 0.15; without knowledge of the whole clip, 0.1. 0 crops nothing.

    Raises
    ------
    ArgumentError
        The share is not in its range.
    """

    share: float | None = None

    def __post_init__(self) -> None:
        if self.share is not None and not 0 <= self.share <= _MAX_FIXED:
            raise ArgumentError(f"crop is {self.share}: give a share from 0 to {_MAX_FIXED}")

    @classmethod
    def parse(cls, text: str) -> Crop:
        """The crop that ``auto``, ``none`` or a percentage (``10``, ``10%``) means.

        Raises
        ------
        ArgumentError
            The text is none of them.
        """
        if text in _WORDS:
            return _WORDS[text]
        try:
            percent = float(text.removesuffix("%"))
        except ValueError:
            percent = -1.0
        if not 0 <= percent <= 100 * _MAX_FIXED:
            raise ArgumentError(
                f"--crop {text!r}: give auto, none, or the percentage of width and height to cut "
                f"away, from 0 to {100 * _MAX_FIXED:.0f}"
            )
        return cls(percent / 100)

    @property
    def budget(self) -> float:
        """Crop that the correction of a frame may need."""
        if self.share is None:
            return _MAX_AUTO
        return self.share or _MAX_UNCROPPED

    def chosen(self, needed: NDArray[np.float64]) -> float:
        """The share for a clip whose frames need `needed` (N,)."""
        if self.share is not None:
            return self.share
        return min(float(np.quantile(needed, _COVERED, method="higher")), _MAX_AUTO)


AUTO_CROP: Final = Crop()

_WORDS: Final = {"auto": AUTO_CROP, "none": Crop(0.0)}


def needed_crop(view_from_raw: Transform, size_wh: tuple[int, int]) -> NDArray[np.float64]:
    """Smallest crop (...) that hides the border of frames moved by `view_from_raw` (..., 3, 3).

    The crop is centered in the view, which has the frame's `size_wh` (width, height). It is 1 if
    the center of the view is outside of the frame.
    """
    raw_from_view = np.linalg.inv(view_from_raw)
    width, height = size_wh
    x, y = frame_center(size_wh)
    rays = np.array([[-width, width, width, -width], [-height, -height, height, height]]) / 2
    center = raw_from_view[..., :2, :2] @ np.array([x, y]) + raw_from_view[..., :2, 2]
    reach = raw_from_view[..., :2, :2] @ rays  # (..., 2, 4)
    half = np.array([width, height]) / 2
    # The part of each ray that is inside: center + part * reach stays within half of (x, y).
    offset = (center - (x, y))[..., None]
    room = np.where(reach > 0, half[:, None] - offset, half[:, None] + offset)
    part = (room / np.maximum(np.abs(reach), 1e-12)).min(axis=(-2, -1))
    return np.asarray(1 - np.clip(part, 0, 1), dtype=np.float64)


def cropped(view_from_raw: Transform, share: float, size_wh: tuple[int, int]) -> Transform:
    """`view_from_raw` (..., 3, 3), then enlarged about the center so that `share` is cut away."""
    zoom = 1 / (1 - share)
    x, y = frame_center(size_wh)
    enlarged = np.array([[zoom, 0, x - zoom * x], [0, zoom, y - zoom * y], [0, 0, 1]])
    return np.asarray(enlarged @ view_from_raw, dtype=np.float64)
