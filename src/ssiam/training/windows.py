"""Where a tracker would look: windows shifted, rescaled and turned at random against the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.training.batches import SEARCH, TEMPLATE
from ssiam.training.crops import Window, window_around

# Pixels of the search crop that a target's centre may lie from the middle: the response maps
# reach 124, and a target at the edge should show at least a part of itself.
FARTHEST: Final = 112.0

# Shares of the way to a distractor by which a window is shifted towards it.
_TOWARDS: Final = (0.2, 1.0)
# Pixels between the search crop and a target that is told not to be in it.
_CLEAR: Final = 8.0
# Times the log's standard deviation at which scales and stretches are cut off.
_CUT: Final = 2.5


@dataclass(frozen=True)
class WindowSettings:
    """How far windows lie off the truth.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    shift : float
        Pixels of the search crop, at most, in x and in y; all places are equally frequent.
    far : float
        Share 0..1 of search windows that lie up to 112 pixels off and are scaled twice as much.
    scale : float
        Standard deviation of the log of the search window's size.
    stretch : float
        Standard deviation of the log of width against height, of both windows.
    angle : float
        Standard deviation of the roll of both windows, degrees.
    turned : float
        Share 0..1 of search windows that are rolled by any angle, if the target's mask is known:
        a box alone does not tell what the turned target's box is.
    template_shift : float
        Pixels of the template crop, at most: boxes are drawn by hand.
    template_scale : float
        Standard deviation of the log of the template window's size.
    """

    shift: float = 64.0
    far: float = 0.1
    scale: float = 0.15
    stretch: float = 0.05
    angle: float = 2.0
    turned: float = 0.0
    template_shift: float = 3.0
    template_scale: float = 0.04

    def __post_init__(self) -> None:
        if not 0 <= self.shift <= FARTHEST:
            raise ArgumentError(f"shift {self.shift} of windows: give 0 to {FARTHEST} pixels")
        for name in ("far", "turned"):
            if not 0 <= (value := getattr(self, name)) <= 1:
                raise ArgumentError(f"{name} {value} of windows: give a share from 0 to 1")


def template_window(
    xywh: XYWH, mirrored: bool, settings: WindowSettings, rng: np.random.Generator
) -> Window:
    """A window of 127 pixels around a box."""
    window = _varied(window_around(xywh, TEMPLATE), settings.template_scale, settings, rng)
    shift = rng.uniform(-settings.template_shift, settings.template_shift, 2)
    return shifted(replace(window, mirrored=mirrored), shift)


def search_window(
    xywh: XYWH,
    mirrored: bool,
    step_xy: NDArray[np.float64],
    settings: WindowSettings,
    rng: np.random.Generator,
    *,
    turned: bool = False,
    towards_xy: NDArray[np.float64] | None = None,
) -> Window:
    """A window of 255 pixels that shows a box somewhere, rolled by any angle if it is `turned`.

    `step_xy` (2,), pixels of the picture, is how far the camera's shake has moved the target since
    it was last seen; it is added to the shift. `towards_xy` (2,), likewise, leads from the target
    to a distractor, towards which the window is shifted, mostly farther than half of the way.
    """
    far = rng.random() < settings.far
    scale = settings.scale * (2 if far else 1)
    window = _varied(window_around(xywh, SEARCH), scale, settings, rng)
    angle = rng.uniform(-np.pi, np.pi) if turned else window.angle
    window = replace(window, mirrored=mirrored, angle=angle)
    reach = FARTHEST if far else settings.shift
    crop_from_frame = window.crop_from_frame[:2, :2]
    moved = rng.uniform(-reach, reach, 2) + crop_from_frame @ step_xy
    if towards_xy is not None:
        moved = moved / 4 - crop_from_frame @ towards_xy * rng.uniform(*_TOWARDS)
    return shifted(window, np.clip(moved, -FARTHEST, FARTHEST))


def window_away(
    xywh: XYWH,
    size_wh: tuple[int, int],
    mirrored: bool,
    settings: WindowSettings,
    rng: np.random.Generator,
) -> Window | None:
    """A window of 255 pixels at a box's zoom, in the picture, but clear of the box.

    None if there is no room: its centre would lie outside of the picture of `size_wh` pixels.
    """
    window = _varied(window_around(xywh, SEARCH), settings.scale, settings, rng)
    window = replace(window, mirrored=mirrored)
    _, _, w, h = window.seen(xywh)
    least = (SEARCH + max(w, h)) / 2 + _CLEAR
    turn, far = rng.uniform(-np.pi, np.pi), least * rng.uniform(1.0, 1.6)
    direction = np.array([np.cos(turn), np.sin(turn)])
    away = shifted(window, far / np.abs(direction).max() * direction)
    (x, y), (width, height) = away.center_xy, size_wh
    inside = 0 <= x < width and 0 <= y < height
    return away if inside and is_clear(away, xywh) else None


def window_inside(size_wh: tuple[int, int], rng: np.random.Generator) -> Window:
    """Any window of 255 pixels that a picture of `size_wh` pixels fills."""
    side = min(size_wh) * rng.uniform(0.4, 1.0)
    x, y = (side / 2 - 0.5 + rng.random(2) * (np.array(size_wh) - side)).tolist()
    return Window((x, y), side, SEARCH, mirrored=bool(rng.random() < 0.5))


def is_clear(window: Window, xywh: XYWH) -> bool:
    """Whether a window shows nothing of a box, nor of what is close around it."""
    return window.hides(xywh, _CLEAR)


def shifted(window: Window, offset_xy: NDArray[np.float64]) -> Window:
    """The window moved so that what was in its middle is seen (2,) crop pixels from there."""
    frame_from_crop = np.linalg.inv(window.crop_from_frame[:2, :2])
    x, y = np.subtract(window.center_xy, frame_from_crop @ offset_xy).tolist()
    return replace(window, center_xy=(x, y))


def _varied(
    window: Window, scale: float, settings: WindowSettings, rng: np.random.Generator
) -> Window:
    zoom, stretch, turn = np.clip(rng.normal(size=3), -_CUT, _CUT)
    return replace(
        window,
        side=window.side * float(np.exp(scale * zoom)),
        stretch=float(np.exp(settings.stretch / 2 * stretch)),
        angle=float(np.deg2rad(settings.angle * turn)),
    )
