"""Base class of the Siamese trackers, and the shared steps of those with box regression.

The formulas are those of the reference implementation (SiamRPN's loop in pysot), including its
asymmetry of half a pixel between the given box and the reported one.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, Image, map_point
from ssiam.runtime import Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.base import CompleteTracker

CONTEXT: Final = 0.5  # share of width + height that is added to width and to height
TEMPLATE_SIDE: Final = 127  # px, side of the template crop
MIN_SIDE: Final = 10.0  # px, minimum side of a target in the reference loops
REFERENCE_MIN_WH: Final = (MIN_SIDE, MIN_SIDE)
_MIN_SIDE_SHARE: Final = 0.5  # the same for a small first box, in units of its side
_LEAST_SIDE: Final = 1.0  # px, minimum side of any target

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SearchParameters:
    """Hyperparameters for the selection among a Siamese tracker's candidates.

    Parameters
    ----------
    penalty_k : float
        Strength of the penalty on changes of the target's size and aspect ratio.
    window_influence : float
        Weight 0..1 of the cosine window, which prefers candidates near the last position.
    lr : float
        Learning rate of the size, 0..1: how fast it follows the chosen candidate.
    """

    penalty_k: float
    window_influence: float
    lr: float


@dataclass(frozen=True)
class TargetState:
    """Center and size of the target, stabilized pixels."""

    center_xy: tuple[float, float]
    size_wh: tuple[float, float]

    @classmethod
    def from_xywh(cls, xywh: XYWH) -> TargetState:
        """State of a given box: the center is (w - 1) / 2 from the left edge, as in pysot."""
        x, y, w, h = xywh
        return cls((x + (w - 1) / 2, y + (h - 1) / 2), (w, h))

    @classmethod
    def from_reported_xywh(cls, xywh: XYWH) -> TargetState:
        """State whose `xywh` is the given box: the center is w / 2 from the left edge."""
        x, y, w, h = xywh
        return cls((x + w / 2, y + h / 2), (w, h))

    @property
    def xywh(self) -> XYWH:
        """The reported box: the left edge is w / 2 from the center, as in the references."""
        (cx, cy), (w, h) = self.center_xy, self.size_wh
        return cx - w / 2, cy - h / 2, w, h

    @property
    def context_side(self) -> float:
        """Side of the square around the target and its context (pysot's s_z), stabilized pixels."""
        w, h = self.size_wh
        context = CONTEXT * (w + h)
        return math.sqrt((w + context) * (h + context))


TargetT = TypeVar("TargetT")
TrackerT = TypeVar("TrackerT", bound="SiameseTracker[Any]")


class SiameseTracker(CompleteTracker, Generic[TargetT]):
    """Base of the Siamese trackers.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    A subclass stores the state of its target in one object, which `init` passes to `_start`.
    All other attributes are set by the constructor and do not change; clones share them.

    Parameters
    ----------
    distractors : bool
        Whether objects like the target are recognized by their positions
        (`ssiam.trackers.distractors`).
    """

    center_inset = 1.0
    has_template_feature = True
    runs_networks = True

    def __init__(self, distractors: bool = False) -> None:
        self._has_distractors = distractors
        self._target_or_none: TargetT | None = None

    @abstractmethod
    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`."""

    @abstractmethod
    def update(self, view: FrameView) -> Track:
        """The target in the next view."""

    @abstractmethod
    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64."""

    @abstractmethod
    def move_to(self, xywh: XYWH) -> None:
        """Search around `xywh` from now on."""

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, searched around `xywh`."""
        self.move_to(xywh)
        return self.update(view)

    def clone(self: TrackerT) -> TrackerT:
        """A tracker without a target, on the same networks."""
        cloned = object.__new__(type(self))
        cloned.__dict__.update(self.__dict__)
        cloned._target_or_none = None
        return cloned

    def _start(self, target: TargetT) -> None:
        self._target_or_none = target

    @property
    def _target(self) -> TargetT:
        if self._target_or_none is None:
            raise ArgumentError("no target yet: call init(view, xywh) before update or seek")
        return self._target_or_none


def ranked_candidates(
    boxes: Floats, score: Floats, size_wh: Floats, window: Floats, parameters: SearchParameters
) -> tuple[Floats, Floats]:
    """The candidates' ranks (n,), the highest for the best one, and their penalty factors (n,).

    The factors are 0..1; 1 for no change of the target's shape.

    Parameters
    ----------
    boxes : (4, n) float64
        cx, cy, w, h in search-crop pixels.
    score : (n,) float64
        Scores, 0..1.
    size_wh : (2,) float64
        The target's last size in the same pixels.
    window : (n,) float64
        Cosine window, 0..1.
    parameters : SearchParameters
    """
    scale_change = _ratio(_padded(boxes[2], boxes[3]) / _padded(*size_wh))
    aspect_change = _ratio((size_wh[0] / size_wh[1]) / (boxes[2] / boxes[3]))
    penalty = np.exp(-(aspect_change * scale_change - 1) * parameters.penalty_k)
    influence = parameters.window_influence
    return penalty * score * (1 - influence) + window * influence, penalty


def min_size(size_wh: tuple[float, float]) -> tuple[float, float]:
    """Minimum width and height (px) of a target whose first box has `size_wh`.

    The minimum of the references, or half of the first box if that is smaller.
    """
    w, h = (min(MIN_SIDE, max(_MIN_SIDE_SHARE * side, _LEAST_SIDE)) for side in size_wh)
    return w, h


def next_state(
    state: TargetState,
    box: Floats,
    zoom: float,
    rate: float,
    view: FrameView,
    min_wh: tuple[float, float] = REFERENCE_MIN_WH,
) -> TargetState:
    """The result of `updated_state`, clamped by `clamped_state`."""
    return clamped_state(updated_state(state, box, zoom, rate), view, min_wh)


def updated_state(state: TargetState, box: Floats, zoom: float, rate: float) -> TargetState:
    """State with the candidate's center, and a size between the last one and the candidate's.

    Parameters
    ----------
    state : TargetState
        The last state, around which the search region was cut.
    box : (4,) float64
        cx, cy, w, h in search-crop pixels from the crop's center.
    zoom : float
        Search-crop pixels per stabilized pixel.
    rate : float
        Share 0..1 of the candidate's size in the new one.
    """
    cx, cy, w, h = (box / zoom).tolist()
    rate = float(rate)
    new_w = state.size_wh[0] * (1 - rate) + w * rate
    new_h = state.size_wh[1] * (1 - rate) + h * rate
    return TargetState((state.center_xy[0] + cx, state.center_xy[1] + cy), (new_w, new_h))


def clamped_state(
    state: TargetState, view: FrameView, min_wh: tuple[float, float] = REFERENCE_MIN_WH
) -> TargetState:
    """The state with its center inside of the frame, and a size from `min_wh` to the frame's."""
    w, h = (
        min(max(side, least), most)
        for side, least, most in zip(state.size_wh, min_wh, view.size_wh, strict=True)
    )
    return TargetState(_inside_frame(view, state.center_xy), (float(w), float(h)))


def min_size_iou(
    state: TargetState,
    candidate_wh: Floats,
    min_wh: tuple[float, float] = REFERENCE_MIN_WH,
) -> float:
    """Maximum IoU of a box of the minimum size with its candidate; 1 for a larger box.

    `candidate_wh` (2,) is the candidate's size in the state's pixels. The score is multiplied by
    this IoU: it is then above 0.5 only if the box can overlap the target by more than half.
    """
    overlap = 1.0
    for side, candidate, minimum in zip(state.size_wh, candidate_wh.tolist(), min_wh, strict=True):
        if side <= minimum:
            overlap *= min(candidate / side, 1.0)
    return overlap


def crop_corner(center_xy: tuple[float, float], side: int) -> Floats:
    """Left and top edge (2,) of the square that `FrameView.crop_square` cuts out, whole pixels."""
    return np.floor(np.asarray(center_xy) - (side + 1) / 2 + 0.5)


def crop_tensor(crop: Image) -> Tensor:
    """A crop (side, side, 3) uint8 as a network input: (1, 3, side, side) float32 in 0..255."""
    return np.ascontiguousarray(crop.transpose(2, 0, 1)[None], dtype=np.float32)


def flattened(features: Sequence[Tensor]) -> Floats:
    """All numbers of a network's outputs in one vector, float64."""
    return np.concatenate([each.ravel() for each in features]).astype(np.float64)


def foreground_probability(score_maps: Tensor) -> Floats:
    """Softmax of score maps (1, 2 * a, n, n), background first -> foreground (a * n * n,)."""
    background, foreground = score_maps[0].reshape(2, -1).astype(np.float64)
    return np.asarray(1 / (1 + np.exp(background - foreground)))


def sigmoid(logits: Tensor) -> Floats:
    """Probabilities (n * n,) of logits (1, 1, n, n)."""
    return np.asarray((1 + np.tanh(logits.ravel().astype(np.float64) / 2)) / 2)


def cosine_window(side: int) -> Floats:
    """Outer product of two Hanning windows, flattened: (side * side,)."""
    hanning = np.hanning(side)
    return np.outer(hanning, hanning).ravel()


def grid_points(offsets: NDArray[np.floating[Any]]) -> Floats:
    """All points (2, n * n) of a square grid, row by row, from their offsets (n,) on one axis."""
    return np.asarray(np.meshgrid(offsets, offsets), dtype=np.float64).reshape(2, -1)


def boxes_from_distances(distances: Tensor, points_xy: Floats) -> Floats:
    """Boxes (4, n * n), cx, cy, w, h, of an anchor-free head.

    Parameters
    ----------
    distances : (1, 4, n, n) float32
        From each cell's point to the left, top, right and bottom edge, pixels.
    points_xy : (2, n * n) float64
        The cells' points, in the same pixels as the result.
    """
    left, top, right, bottom = distances[0].reshape(4, -1).astype(np.float64)
    x, y = points_xy
    return np.stack([x + (right - left) / 2, y + (bottom - top) / 2, left + right, top + bottom])


def boxes_in_view(boxes: Floats, zoom: float, last: TargetState) -> Floats:
    """Boxes (4, n), cx, cy, w, h, in pixels of the view.

    Parameters
    ----------
    boxes : (4, n) float64
        In search-crop pixels, cx and cy from the crop's center.
    zoom : float
        Search-crop pixels per pixel of the view.
    last : TargetState
        The state around which the search region was cut.
    """
    scaled = boxes / zoom
    scaled[:2] += np.array(last.center_xy)[:, None]
    return scaled


def _inside_frame(view: FrameView, center_xy: tuple[float, float]) -> tuple[float, float]:
    """The point of the raw frame nearest to a stabilized point, in stabilized pixels."""
    (x, y), (width, height) = center_xy, view.size_wh
    if not view.is_raw:
        x, y = map_point(view.raw_from_stab, x, y)
    if 0 <= x <= width and 0 <= y <= height:
        return float(center_xy[0]), float(center_xy[1])
    x, y = float(min(max(x, 0), width)), float(min(max(y, 0), height))
    return (x, y) if view.is_raw else map_point(view.stab_from_raw, x, y)


def _ratio(value: Floats) -> Floats:
    return np.maximum(value, 1 / value)


def _padded(w: Floats, h: Floats) -> Floats:
    context = (w + h) * CONTEXT
    return np.sqrt((w + context) * (h + context))
