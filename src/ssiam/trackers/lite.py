"""`LiteTracker`: the default tracker, with a memory of a recent template and masks on request.

The loop is that of the other Siamese trackers. The score of a cell is the probability that it is on
the target, times the expected IoU of its box. The references' asymmetry of half a pixel is avoided:
the center of a box is x + w / 2, and positions in a crop count from the crop's actual corner.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from ssiam.errors import ArgumentError, WeightsError
from ssiam.geometry import XYWH, mean_color
from ssiam.runtime import Network, RuntimeOptions, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.box_mask import MASK_SHAPES, BoxMask
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.distractors import DistractorTracker, ScoredCandidates
from ssiam.trackers.responses import Response
from ssiam.trackers.siamese import (
    TEMPLATE_SIDE,
    Floats,
    SearchParameters,
    SiameseTracker,
    TargetState,
    boxes_from_distances,
    cosine_window,
    crop_corner,
    crop_tensor,
    flattened,
    grid_points,
    min_size,
    min_size_iou,
    next_state,
    ranked_candidates,
    sigmoid,
)

LiteName: TypeAlias = Literal["lite"]
SHIPPED: Final = Path(__file__).parents[1] / "models" / "lite"
NETWORK: Final = "lite2"  # its name in network.json; "lite" was another network

SEARCH_SIDE: Final = 255  # px, side of the search crop
_STRIDE: Final = 16  # px between cells
_SIDE: Final = 15  # cells
_CROPS: Final = (1, 3, TEMPLATE_SIDE, TEMPLATE_SIDE), (1, 3, SEARCH_SIDE, SEARCH_SIDE)
_KERNELS: Final = [(1, 64, 96), (1, 64, 96), (1, 96, 4, 4), (1, 96, 4, 4)]
_CONTEXT: Final = (2, 96, 64)  # of each attention block
_MAPS: Final = [(1, 1, _SIDE, _SIDE), (1, 1, _SIDE, _SIDE), (1, 4, _SIDE, _SIDE)]
_LOGIT_RANGE: Final = (-8.0, 8.0)  # to which the evidence is clipped

# From benchmarks/calibration/search_parameters.py, on videos left out of training. These prefer a
# faster `lr` of 0.75 by .004; among small targets in groups, an earlier network lost with 0.8.
PARAMETERS: Final = SearchParameters(penalty_k=0.1, window_influence=0.3, lr=0.5)
CONFIDENCE: Final = Confidence((0.96, 2.68), -6.0)  # benchmarks/calibration/confidence.py
MASK_THRESHOLD: Final = 0.5


@dataclass(frozen=True)
class Memory:
    """When the recent template is replaced.

    Attributes
    ----------
    interval : int
        Minimum number of frames between two replacements; 0 to keep the first template.
    min_score : float
        Minimum score of the chosen cell, 0..1.
    max_distractor_share : float
        The template is not replaced if a cell outside of the target's box, which may be on a
        distractor, has at least this share (0..1) of the chosen cell's score.
    """

    interval: int = 0
    min_score: float = 0.6
    max_distractor_share: float = 0.5


MEMORY: Final = Memory()


@dataclass(frozen=True)
class LiteNetworks:
    """The networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` maps (1, 3, 127, 127) float32 BGR in 0..255 to the kernels of
    `ssiam.networks.lite.LiteNetwork.template`, their context last; `search` maps
    (1, 3, 255, 255), the kernels and the context of a recent template to logits of score and
    quality (1, 1, 15, 15), and distances (1, 4, 15, 15) in px. `mask`, if the weights have one,
    is the network of `ssiam.trackers.box_mask`.
    """

    template: Network
    search: Network
    mask: Network | None = None

    @classmethod
    def load(cls, weights: Path, options: RuntimeOptions) -> LiteNetworks:
        """Load the networks from a folder that `ssiam train` has written.

        Raises
        ------
        WeightsError
            The weights are missing, damaged or of another network.
        ArgumentError
            The runtime is "torch", or the precision is "int8" and the weights are in float32.
        """
        from ssiam.runtime.loading import load_pieces

        if options.runtime == "torch":
            raise ArgumentError("tracker lite is in ONNX: choose runtime openvino or onnxruntime")
        pieces = load_pieces(weights, NETWORK, options)
        networks = cls(pieces["template"], pieces["search"], pieces.get("mask"))
        if not networks._have_the_shapes_of_lite():
            raise WeightsError(
                f"{weights} holds weights of another network than lite: the inputs and outputs of "
                "its pieces have other shapes"
            )
        return networks

    def responses(self, crop: Tensor, kernels: list[Tensor], recent: Tensor) -> list[Tensor]:
        """Outputs of `search` for a crop, the kernels, and the context of a recent template.

        A network without attention takes no context: inputs beyond its last one are dropped.
        """
        inputs = crop, *kernels, recent
        return self.search(*inputs[: len(self.search.input_shapes) or None])

    def _have_the_shapes_of_lite(self) -> bool:
        (template_crop, search_crop), mask = _CROPS, self.mask
        kernels, contexts = self.template.output_shapes[:4], self.template.output_shapes[4:]
        inputs = [search_crop, *_KERNELS]
        return (
            self.template.input_shapes == [template_crop]
            and kernels == _KERNELS
            and [(each[0], *each[2:]) for each in contexts if each] == [(1, *_CONTEXT)]
            and self.search.input_shapes in (inputs, [*inputs, *contexts, *contexts])
            and self.search.output_shapes == _MAPS
            and (mask is None or (mask.input_shapes, mask.output_shapes) == MASK_SHAPES)
        )


@dataclass
class _Target:
    """State of the target."""

    state: TargetState
    min_wh: tuple[float, float]
    kernels: list[Tensor]  # of the first template, its context last
    fill: Floats  # color outside of the frame, BGR
    recent: Tensor  # context of the recent template
    recent_age: int  # frames since the recent template was taken
    distractors: DistractorTracker


class _Details(NamedTuple):
    """What `LiteTracker.accept` needs of a response."""

    candidates: ScoredCandidates
    boxes: Floats  # (4, n) cx, cy, w, h in px of the search crop
    zoom: float  # px of the search crop per px of the view
    penalty: Floats  # (n,)
    logits: tuple[Tensor, Tensor]  # of score and quality, (n,)


class LiteTracker(SiameseTracker[_Target]):
    """The loop of `lite`.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    networks : LiteNetworks
    parameters : SearchParameters
    confidence : Confidence
        Its evidence is the logits of the chosen cell's score and quality.
    memory : Memory
    masks : bool
        Whether tracks have masks and rotated boxes, if there is a network for them.
    mask_threshold : float
        Probability above which a pixel belongs to the target.
    distractors : bool
        Whether objects like the target are recognized by their positions.
    """

    def __init__(
        self,
        networks: LiteNetworks,
        parameters: SearchParameters = PARAMETERS,
        confidence: Confidence = CONFIDENCE,
        memory: Memory = MEMORY,
        *,
        masks: bool = True,
        mask_threshold: float = MASK_THRESHOLD,
        distractors: bool = True,
    ) -> None:
        super().__init__(distractors)
        self._networks = networks
        self._parameters = parameters
        self._confidence = confidence
        self._memory = memory
        self._box_mask = (
            BoxMask(networks.mask, mask_threshold) if masks and networks.mask is not None else None
        )
        self._window = cosine_window(_SIDE)
        self._points = grid_points((np.arange(_SIDE) - _SIDE // 2) * float(_STRIDE))

    has_responses = True

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; crops are padded with the frame's mean color."""
        state = TargetState.from_reported_xywh(xywh)
        fill: Floats = mean_color(view.raw)
        kernels = self._template(view, state, fill)
        distractors = DistractorTracker(self._has_distractors)
        min_wh = min_size(state.size_wh)
        self._start(_Target(state, min_wh, kernels, fill, kernels[-1], 0, distractors))

    def update(self, view: FrameView) -> Track:
        """The target in the next view, with mask and corners if there is a network for them."""
        response = self.respond(view)
        return self.accept(view, response, response.best)

    def respond(self, view: FrameView) -> Response:
        """The candidates in the next view."""
        target, last = self._target, self._target.state
        side = round(SEARCH_SIDE / TEMPLATE_SIDE * last.context_side)
        zoom = SEARCH_SIDE / side
        crop = view.crop_square(last.center_xy, side, SEARCH_SIDE, target.fill)
        scores, qualities, distances = self._networks.responses(
            crop_tensor(crop), target.kernels, target.recent
        )
        score = sigmoid(scores) * sigmoid(qualities)
        boxes = boxes_from_distances(distances, self._points)
        # The crop's corner is in whole pixels: its center is not exactly the target's.
        crop_offset = crop_corner(last.center_xy, side) + side / 2 - last.center_xy
        boxes[:2] += crop_offset[:, None] * zoom
        size = np.array(last.size_wh) * zoom
        positions_xy = boxes[:2].T / zoom + last.center_xy
        candidates = target.distractors.detect(positions_xy, score, last)
        ranked, penalty = ranked_candidates(
            boxes, candidates.allowed_score, size, self._window, self._parameters
        )
        logits = scores.ravel(), qualities.ravel()
        details = _Details(candidates, boxes, zoom, penalty, logits)
        view_boxes = np.vstack([positions_xy.T, boxes[2:] / zoom])
        peaks, near = candidates.peaks, candidates.near
        return Response(view_boxes, score, ranked, peaks, near, details)

    def accept(self, view: FrameView, response: Response, index: int) -> Track:
        """Take a candidate as the target."""
        target, last, score = self._target, self._target.state, response.score
        details: _Details = response.details
        boxes, zoom = details.boxes, details.zoom
        target.distractors.update(details.candidates, index)
        rate = details.penalty[index] * score[index] * self._parameters.lr
        target.state = next_state(last, boxes[:, index], zoom, rate, view, target.min_wh)
        self._update_memory(target, view, boxes, score, index)
        logits = (float(logits[index]) for logits in details.logits)
        evidence = tuple(float(np.clip(logit, *_LOGIT_RANGE)) for logit in logits)
        probability = self._confidence.probability(evidence)
        probability *= min_size_iou(target.state, boxes[2:, index] / zoom, target.min_wh)
        track = Track(target.state.xywh, probability, evidence=evidence)
        if self._box_mask is None:
            return track
        outline = self._box_mask.outline(view, track.box, target.fill)
        return track.with_changes(corners=outline, mask=outline)

    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64."""
        return flattened(self._target.kernels)

    def move_to(self, xywh: XYWH) -> None:
        """Search around `xywh`, the view's pixels, from now on."""
        target = self._target
        target.state = TargetState.from_reported_xywh(xywh)
        target.distractors = DistractorTracker(self._has_distractors)
        target.recent, target.recent_age = target.kernels[-1], 0

    def _template(self, view: FrameView, state: TargetState, fill: Floats) -> list[Tensor]:
        """Kernels and context of the target in this view."""
        crop = view.crop_square(state.center_xy, round(state.context_side), TEMPLATE_SIDE, fill)
        return self._networks.template(crop_tensor(crop))

    def _update_memory(
        self, target: _Target, view: FrameView, boxes: Floats, score: Floats, best: int
    ) -> None:
        """Replace the recent template if the score is high and there is no distractor."""
        target.recent_age += 1
        memory = self._memory
        is_due = 0 < memory.interval <= target.recent_age
        if not is_due or score[best] < memory.min_score:
            return
        outside = np.abs(boxes[:2] - boxes[:2, best : best + 1]) > boxes[2:, best : best + 1] / 2
        others = score[outside.any(axis=0)]
        if not len(others) or others.max() < memory.max_distractor_share * score[best]:
            target.recent = self._template(view, target.state, target.fill)[-1]
            target.recent_age = 0
