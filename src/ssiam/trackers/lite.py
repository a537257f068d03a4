"""`LiteTracker`: the default tracker, a small anchor-free Siamese tracker with masks.

The loop is that of the other Siamese trackers. The score of a cell is the probability that it is on
the target, times the expected IoU of its box. The references' asymmetry of half a pixel is avoided:
the center of a box is x + w / 2, and positions in a crop count from the crop's actual corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from ssiam.errors import ArgumentError, WeightsError
from ssiam.geometry import XYWH
from ssiam.runtime import Network, RuntimeOptions, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Outline, PendingOutline, Track
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.distractors import DistractorTracker
from ssiam.trackers.lite_mask import crop_corner, pasted_mask, rotated_box
from ssiam.trackers.siamese import (
    TEMPLATE_SIDE,
    Floats,
    SearchParameters,
    SiameseTracker,
    TargetState,
    boxes_from_distances,
    cosine_window,
    crop_tensor,
    flattened,
    grid_points,
    min_size,
    min_size_iou,
    next_state,
    select_candidate,
    sigmoid,
)

LiteName: TypeAlias = Literal["lite"]
SHIPPED: Final = Path(__file__).parents[1] / "models" / "lite"

SEARCH_SIDE: Final = 255  # px, side of the search crop
_STRIDE: Final = 8  # px between cells
_SIDE: Final = 32  # cells
_KERNEL: Final = (1, 64, 96)
_SHAPES: Final = [  # of the inputs and outputs of template and search, see `LiteNetworks`
    [(1, 3, TEMPLATE_SIDE, TEMPLATE_SIDE)],
    [_KERNEL],
    [(1, 3, SEARCH_SIDE, SEARCH_SIDE), _KERNEL],
    [*[(1, 1, _SIDE, _SIDE)] * 2, (1, 4, _SIDE, _SIDE), (1, 1, 2 * _SIDE, 2 * _SIDE)],
]
_LOGIT_RANGE: Final = (-8.0, 8.0)  # to which the evidence is clipped

# From benchmarks/calibration/search_parameters.py, on videos left out of training.
PARAMETERS: Final = SearchParameters(penalty_k=0.1, window_influence=0.1, lr=0.6)
CONFIDENCE: Final = Confidence((1.61, 1.02), -0.92)  # from benchmarks/calibration/confidence.py
MASK_THRESHOLD: Final = 0.2  # from benchmarks/calibration/mask_threshold.py


@dataclass(frozen=True)
class LiteNetworks:
    """The networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` maps (1, 3, 127, 127) float32 BGR in 0..255 to a kernel (1, 64, 96); `search` maps
    (1, 3, 255, 255) and the kernel to logits of score and quality (1, 1, 32, 32), distances
    (1, 4, 32, 32) in px, and logits of the mask (1, 1, 64, 64).
    """

    template: Network
    search: Network

    @classmethod
    def load(cls, weights: Path, options: RuntimeOptions) -> LiteNetworks:
        """Load the networks from a folder that `ssiam train` has written.

        Raises
        ------
        WeightsError
            The weights are missing, damaged or of another network.
        ArgumentError
            The runtime is "torch" or the precision "int8".
        """
        from ssiam.runtime.loading import load_pieces

        if options.runtime == "torch":
            raise ArgumentError("tracker lite is in ONNX: choose runtime openvino or onnxruntime")
        if options.precision == "int8":
            raise ArgumentError("tracker lite has no int8 weights: leave precision out")
        pieces = load_pieces(weights, "lite", options)
        networks = cls(pieces["template"], pieces["search"])
        networks._check(weights)
        return networks

    def _check(self, weights: Path) -> None:
        shapes = [
            *(self.template.input_shapes, self.template.output_shapes),
            *(self.search.input_shapes, self.search.output_shapes),
        ]
        if shapes != _SHAPES:
            raise WeightsError(
                f"{weights} holds weights of another network than lite, with inputs and outputs "
                f"{shapes}; expected {_SHAPES}"
            )


@dataclass
class _Target:
    """State of the target."""

    state: TargetState
    min_wh: tuple[float, float]
    kernel: Tensor
    fill: Floats  # color outside of the frame, BGR
    distractors: DistractorTracker


class LiteTracker(SiameseTracker[_Target]):
    """The loop of `lite`.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    networks : LiteNetworks
    parameters : SearchParameters
    confidence : Confidence
        Its evidence is the logits of the chosen cell's score and quality.
    masks : bool
        Whether tracks have masks and rotated boxes.
    mask_threshold : float
        Probability above which a pixel belongs to the target. The default is below one half: the
        IoU of masks is best if uncertain pixels are included.
    distractors : bool
        Whether objects like the target are recognized by their positions.
    """

    def __init__(
        self,
        networks: LiteNetworks,
        parameters: SearchParameters = PARAMETERS,
        confidence: Confidence = CONFIDENCE,
        *,
        masks: bool = True,
        mask_threshold: float = MASK_THRESHOLD,
        distractors: bool = True,
    ) -> None:
        super().__init__(distractors)
        self._networks = networks
        self._parameters = parameters
        self._confidence = confidence
        self._masks = masks
        self._threshold_logit = math.log(mask_threshold / (1 - mask_threshold))
        self._window = cosine_window(_SIDE)
        self._points = grid_points((np.arange(_SIDE) - (_SIDE - 1) / 2) * _STRIDE)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; crops are padded with the frame's mean color."""
        state = TargetState.from_reported_xywh(xywh)
        fill: Floats = view.raw.mean(axis=(0, 1))
        crop = view.crop(state.center_xy, round(state.context_side), TEMPLATE_SIDE, fill)
        (kernel,) = self._networks.template(crop_tensor(crop))
        min_wh = min_size(state.size_wh)
        self._start(_Target(state, min_wh, kernel, fill, DistractorTracker(self._has_distractors)))

    def track(self, view: FrameView) -> Track:
        """The target in the next view, with mask and corners unless `masks` is off."""
        target, last = self._target, self._target.state
        side = round(SEARCH_SIDE / TEMPLATE_SIDE * last.context_side)
        zoom = SEARCH_SIDE / side
        crop = view.crop(last.center_xy, side, SEARCH_SIDE, target.fill)
        scores, qualities, distances, mask_logits = self._networks.search(
            crop_tensor(crop), target.kernel
        )
        score = sigmoid(scores) * sigmoid(qualities)
        boxes = boxes_from_distances(distances, self._points)
        # The crop's corner is in whole pixels: its center is not exactly the target's.
        crop_offset = crop_corner(last.center_xy, side) + side / 2 - last.center_xy
        boxes[:2] += crop_offset[:, None] * zoom
        size = np.array(last.size_wh) * zoom
        candidates = target.distractors.detect(boxes[:2].T / zoom + last.center_xy, score, last)
        best, penalty = select_candidate(
            boxes, candidates.allowed_score, size, self._window, self._parameters
        )
        target.distractors.update(candidates, best)
        rate = penalty * score[best] * self._parameters.lr
        target.state = next_state(last, boxes[:, best], zoom, rate, view, target.min_wh)
        logits = (float(logit_map.ravel()[best]) for logit_map in (scores, qualities))
        evidence = tuple(float(np.clip(logit, *_LOGIT_RANGE)) for logit in logits)
        probability = self._confidence.probability(evidence)
        probability *= min_size_iou(target.state, boxes[2:, best] / zoom, target.min_wh)
        track = Track(target.state.xywh, probability, evidence=evidence)
        if not self._masks:
            return track
        # A stabilized view shows parts of the raw frame beyond its own edges.
        margin = 0 if view.is_raw else view.border
        above_threshold = mask_logits - self._threshold_logit
        outline = PendingOutline(
            partial(
                _outline, above_threshold, last.center_xy, side, track.box, view.size_wh, margin
            )
        )
        return track.with_changes(corners=outline, mask=outline)

    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64."""
        return flattened([self._target.kernel])

    def _move_to(self, xywh: XYWH) -> None:
        self._target.state = TargetState.from_reported_xywh(xywh)
        self._target.distractors = DistractorTracker(self._has_distractors)


def _outline(
    logits: Tensor,
    center_xy: tuple[float, float],
    crop_side: int,
    xywh: XYWH,
    size_wh: tuple[int, int],
    margin: int,
) -> Outline:
    """The mask in the view's pixels and its rotated box; parameters as of `pasted_mask`."""
    mask = pasted_mask(logits, center_xy, crop_side, xywh, size_wh, margin)
    return Outline(rotated_box(mask, xywh), mask.full(size_wh))
