"""`LockedConfig`: what the locked view shows, and how its camera may move."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, get_args

from ssiam.errors import ArgumentError, check_choice

Aspect: TypeAlias = Literal["source", "16:9", "1:1", "9:16"]
Zoom: TypeAlias = Literal["follow", "fixed"]
Position: TypeAlias = Literal["middle", "left third", "right third", "upper third", "lower third"]
ASPECTS: Final[tuple[Aspect, ...]] = get_args(Aspect)
ZOOMS: Final[tuple[Zoom, ...]] = get_args(Zoom)
POSITIONS: Final[tuple[Position, ...]] = get_args(Position)

_RATIOS: Final = {"16:9": 16 / 9, "1:1": 1.0, "9:16": 9 / 16}
_SHARES: Final = {  # of the view's width and height
    "middle": (1 / 2, 1 / 2),
    "left third": (1 / 3, 1 / 2),
    "right third": (2 / 3, 1 / 2),
    "upper third": (1 / 2, 1 / 3),
    "lower third": (1 / 2, 2 / 3),
}

# Of the target: the smallest one whose paths are smooth on shaken clips of DAVIS, SoccerNet and
# MOTChallenge (docs/decisions/0008-locked-view.md)
_TOLERANCE: Final = 0.04
_MARGIN: Final = 1.1  # sizes of the target that the smallest view shows


@dataclass(frozen=True)
class LockedConfig:
    """Settings of the locked view.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    aspect : {"source", "16:9", "1:1", "9:16"}
        Width and height of the view.
    zoom : {"follow", "fixed"}
        "follow": the view's size follows that of the target. "fixed": one size for the whole clip.
    position : {"middle", "left third", "right third", "upper third", "lower third"}
        Where the target is in the view.
    target_share : float
        0 to 1: share of the view's width or height, whichever is larger, that the target fills.
    max_zoom : float
        1 or more: largest magnification, in relation to the largest view that the frame holds;
        up to twice as much at the edge of the frame, to hold the target in the middle.
    tolerance : float
        Distance of the target from its position that is accepted for a smoother camera, in sizes
        of the target (square root of its area).
    max_speed : float
        Of the virtual camera, frame widths per second, in scene coordinates.
    max_acceleration : float
        Of the virtual camera, frame widths per second squared, in scene coordinates.
    max_zoom_speed : float
        More than 1: largest factor by which the magnification changes in a second.

    Raises
    ------
    ArgumentError
        A value is not one of the choices, or out of its range.
    """

    aspect: Aspect = "source"
    zoom: Zoom = "follow"
    position: Position = "middle"
    target_share: float = 0.35
    max_zoom: float = 4.0
    tolerance: float = _TOLERANCE
    max_speed: float = 3.0
    max_acceleration: float = 40.0
    max_zoom_speed: float = 2.0

    def __post_init__(self) -> None:
        check_choice("aspect", self.aspect, ASPECTS)
        check_choice("zoom", self.zoom, ZOOMS)
        check_choice("position", self.position, POSITIONS)
        if not 0 < self.target_share <= 1:
            raise ArgumentError(
                f"target_share is {self.target_share}: give a share of the view, from 0 to 1"
            )
        if not 1 <= self.max_zoom < math.inf:
            raise ArgumentError(f"max_zoom is {self.max_zoom}: give a magnification of 1 or more")
        if not 1 < self.max_zoom_speed < math.inf:
            raise ArgumentError(
                f"max_zoom_speed is {self.max_zoom_speed}: give a factor of more than 1 per second"
            )
        for name in ("tolerance", "max_speed", "max_acceleration"):
            if not 0 < (value := getattr(self, name)) < math.inf:
                raise ArgumentError(f"{name} is {value}: give a number more than 0")

    @property
    def position_xy(self) -> tuple[float, float]:
        """Where the target is in the view, in shares of its width and height."""
        return _SHARES[self.position]

    @property
    def least_share(self) -> float:
        """Width of the smallest view that contains the target, in widths of the target."""
        return _MARGIN * 0.5 / min(*self.position_xy, *(1 - share for share in self.position_xy))

    def ratio(self, size_wh: tuple[int, int]) -> float:
        """Width of the view divided by its height, for frames of (width, height) pixels."""
        return _RATIOS.get(self.aspect, size_wh[0] / size_wh[1])

    def full_width(self, size_wh: tuple[int, int]) -> float:
        """Width of the largest view inside a frame of (width, height) pixels."""
        return min(float(size_wh[0]), size_wh[1] * self.ratio(size_wh))

    def least_width(self, size_wh: tuple[int, int]) -> float:
        """Width of the view at the largest magnification."""
        return self.full_width(size_wh) / self.max_zoom

    def size_wh(self, size_wh: tuple[int, int]) -> tuple[int, int]:
        """Width and height of the output for frames of (width, height) pixels; even."""
        width = self.full_width(size_wh)
        height = width / self.ratio(size_wh)
        return max(2, 2 * round(width / 2)), max(2, 2 * round(height / 2))
