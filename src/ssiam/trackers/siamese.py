"""What all Siamese trackers with box regression share: search regions, penalties, size update.

The formulas are those of the reference implementation (SiamRPN's loop in pysot), with its half
pixel of asymmetry between the box that comes in and the one that goes out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image, map_points
from ssiam.runtime import Tensor
from ssiam.stabilize import FrameView

CONTEXT = 0.5  # of width + height, added around the target
EXEMPLAR = 127  # px, side of the template crop
MIN_SIDE: Final = 10.0  # px, the smallest side that the reference loops give a target
REFERENCE_FLOOR: Final = (MIN_SIDE, MIN_SIDE)
_FLOOR_SHARE: Final = 0.5  # of a first box's side that is smaller than twice MIN_SIDE
_LEAST_SIDE: Final = 1.0  # px

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SearchParameters:
    """The three numbers that steer a Siamese tracker's choice.

    Parameters
    ----------
    penalty_k : float
        How strongly a change of the target's size or shape counts against a candidate.
    window_influence : float
        Weight 0..1 of the cosine window, which prefers candidates near the last place.
    lr : float
        How fast the size follows the chosen candidate, 0..1.
    """

    penalty_k: float
    window_influence: float
    lr: float


@dataclass(frozen=True)
class TargetState:
    """Centre and size of the target in steadied pixels."""

    center_xy: tuple[float, float]
    size_wh: tuple[float, float]

    @classmethod
    def from_xywh(cls, xywh: XYWH) -> TargetState:
        """State of a first box: its centre is that of its pixels, (w - 1) / 2 from the left."""
        x, y, w, h = xywh
        return cls((x + (w - 1) / 2, y + (h - 1) / 2), (w, h))

    @property
    def xywh(self) -> XYWH:
        """The box that is reported: w / 2 to the left of the centre, as the references do."""
        (cx, cy), (w, h) = self.center_xy, self.size_wh
        return cx - w / 2, cy - h / 2, w, h

    @property
    def context_side(self) -> float:
        """Side of the square that holds the target and its context (s_z), unrounded pixels."""
        w, h = self.size_wh
        context = CONTEXT * (w + h)
        return float(np.sqrt((w + context) * (h + context)))


def state_at(xywh: XYWH) -> TargetState:
    """The state whose reported box is `xywh`."""
    x, y, w, h = xywh
    return TargetState((x + w / 2, y + h / 2), (w, h))


def choose(
    boxes: Floats, score: Floats, size_wh: Floats, window: Floats, parameters: SearchParameters
) -> tuple[int, float]:
    """Index of the best candidate, and its penalty factor 0..1.

    `boxes` (4, n): cx, cy, w, h in pixels of the search region; `score` (n,) 0..1; `size_wh` (2,)
    the last size in the same pixels; `window` (n,) cosine window.
    """
    change = _ratio(_padded(boxes[2], boxes[3]) / _padded(*size_wh))
    shape = _ratio((size_wh[0] / size_wh[1]) / (boxes[2] / boxes[3]))
    penalty = np.exp(-(shape * change - 1) * parameters.penalty_k)
    influence = parameters.window_influence
    ranked = penalty * score * (1 - influence) + window * influence
    best = int(np.argmax(ranked))
    return best, float(penalty[best])


def smallest_size(size_wh: tuple[float, float]) -> tuple[float, float]:
    """Smallest width and height (px) that a target is given whose first box had `size_wh`.

    That of the references, but half of the first box for targets that are small themselves.
    """
    w, h = (min(MIN_SIDE, max(_FLOOR_SHARE * side, _LEAST_SIDE)) for side in size_wh)
    return w, h


def moved(
    state: TargetState,
    box: Floats,
    zoom: float,
    rate: float,
    view: FrameView,
    floor_wh: tuple[float, float] = REFERENCE_FLOOR,
) -> TargetState:
    """State after the chosen candidate, as `followed`, kept in reach of the frame."""
    return kept_inside(followed(state, box, zoom, rate), view, floor_wh)


def floor_overlap(
    state: TargetState,
    seen_wh: Floats,
    floor_wh: tuple[float, float] = REFERENCE_FLOOR,
) -> float:
    """Overlap (IoU) that a box which may not be smaller can have with the candidate; else 1.

    `seen_wh` (2,) is the candidate's size in the state's pixels. A score times this overlap is
    at least 0.5 only where the box can be right.
    """
    overlap = 1.0
    for side, seen, floor in zip(state.size_wh, seen_wh.tolist(), floor_wh, strict=True):
        if side <= floor:
            overlap *= min(seen / side, 1.0)
    return overlap


def followed(state: TargetState, box: Floats, zoom: float, rate: float) -> TargetState:
    """State after the chosen candidate `box` (cx, cy, w, h), relative to the search centre.

    `zoom` is search-region pixels per steadied pixel; `rate` 0..1 is how far the size follows.
    The place is taken over whole.
    """
    cx, cy, w, h = box / zoom
    new_w = state.size_wh[0] * (1 - rate) + w * rate
    new_h = state.size_wh[1] * (1 - rate) + h * rate
    return TargetState(
        (state.center_xy[0] + cx, state.center_xy[1] + cy), (float(new_w), float(new_h))
    )


def kept_inside(
    state: TargetState, view: FrameView, floor_wh: tuple[float, float] = REFERENCE_FLOOR
) -> TargetState:
    """The state with its centre inside of the frame, and no smaller or larger than may be."""
    w, h = np.clip(state.size_wh, floor_wh, view.size_wh).tolist()
    return TargetState(_inside(view, state.center_xy), (w, h))


def crop_tensor(crop: Image) -> Tensor:
    """A crop (side, side, 3) uint8 as networks take it: (1, 3, side, side) float32 in 0..255."""
    return np.ascontiguousarray(crop.transpose(2, 0, 1)[None], dtype=np.float32)


def foreground(score_maps: Tensor) -> Floats:
    """Softmax of score maps (1, 2 * a, n, n), background first -> foreground (a * n * n,)."""
    background, target = score_maps[0].reshape(2, -1).astype(np.float64)
    return np.asarray(1 / (1 + np.exp(background - target)))


def sigmoid(logits: Tensor) -> Floats:
    """Probabilities (n * n,) of logits (1, 1, n, n)."""
    return np.asarray((1 + np.tanh(logits.ravel().astype(np.float64) / 2)) / 2)


def cosine_window(side: int) -> Floats:
    """Outer product of two Hanning windows, flattened: (side * side,)."""
    hanning = np.hanning(side)
    return np.outer(hanning, hanning).ravel()


def _inside(view: FrameView, center_xy: tuple[float, float]) -> tuple[float, float]:
    """The point of the raw frame nearest to a steadied point, in steadied coordinates."""
    limits = view.size_wh
    if view.is_raw:
        cx, cy = np.clip(center_xy, 0, limits)
        return float(cx), float(cy)
    raw = map_points(view.raw_from_stab, [center_xy])[0]
    if (raw >= 0).all() and (raw <= limits).all():
        return float(center_xy[0]), float(center_xy[1])
    cx, cy = map_points(view.stab_from_raw, [np.clip(raw, 0, limits)])[0]
    return float(cx), float(cy)


def _ratio(value: Floats) -> Floats:
    return np.maximum(value, 1 / value)


def _padded(w: Floats, h: Floats) -> Floats:
    context = (w + h) * CONTEXT
    return np.sqrt((w + context) * (h + context))
