"""SiamRPN and SiamRPN++: the best candidate of a grid of anchor boxes.

The loop is that of STVIR/pysot (Li et al., SiamRPN, CVPR 2018; SiamRPN++, CVPR 2019), or, with
``variant="siammask"``, that of foolwood/SiamMask.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from ssiam.geometry import XYWH, mean_color
from ssiam.runtime import Network, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.anchors import ANCHORS, anchor_boxes, cell_of, decode, response_side
from ssiam.trackers.distractors import DistractorTracker
from ssiam.trackers.reference_crops import Crop, pysot_crop, siammask_crop
from ssiam.trackers.siamese import (
    TEMPLATE_SIDE,
    Floats,
    SearchParameters,
    SiameseTracker,
    TargetState,
    clamped_state,
    cosine_window,
    crop_tensor,
    flattened,
    foreground_probability,
    min_size_iou,
    select_candidate,
    updated_state,
)

SiamRpnName: TypeAlias = Literal[
    "siamrpn_r50_l234_dwxcorr",
    "siamrpn_r50_l234_dwxcorr_otb",
    "siamrpn_mobilev2_l234_dwxcorr",
    "siamrpn_alex_dwxcorr",
]
Variant: TypeAlias = Literal["pysot", "siammask"]


@dataclass(frozen=True)
class SiamRpnParameters(SearchParameters):
    """Hyperparameters of a tracker with anchors, with their names in pysot in parentheses.

    Parameters
    ----------
    penalty_k, window_influence, lr : float
        As in `SearchParameters`.
    instance : int
        Side of the search crop, pixels (INSTANCE_SIZE).
    base : int
        Cells of the response map beyond those of a network without padding (BASE_SIZE).
    variant : {"pysot", "siammask"}
        The implementation that is reproduced. In the loop of SiamMask's authors the center of the
        first box is x + w / 2, not x + (w - 1) / 2, and crop corners are rounded half to even.
    """

    instance: int = 255
    base: int = 8
    variant: Variant = "pysot"

    @property
    def side(self) -> int:
        """Number of cells along the side of the response map."""
        return response_side(self.instance, self.base)


PARAMETERS: Final[dict[SiamRpnName, SiamRpnParameters]] = {
    "siamrpn_r50_l234_dwxcorr": SiamRpnParameters(0.05, 0.42, 0.38),
    "siamrpn_r50_l234_dwxcorr_otb": SiamRpnParameters(0.24, 0.5, 0.25),
    "siamrpn_mobilev2_l234_dwxcorr": SiamRpnParameters(0.04, 0.4, 0.5),
    "siamrpn_alex_dwxcorr": SiamRpnParameters(0.16, 0.4, 0.3, instance=287, base=0),
}


@dataclass(frozen=True)
class SiamRpnNetworks:
    """The two networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` maps (1, 3, 127, 127) float32 BGR in 0..255 to kernels. `search` maps a crop
    (1, 3, S, S) and the kernels to logits (1, 10, n, n), background first, box regression
    (1, 20, n, n), and possibly further outputs.
    """

    template: Network
    search: Network


@dataclass(frozen=True, eq=False)
class Candidate:
    """The best candidate in one search region.

    Attributes
    ----------
    state : TargetState
        The updated state, before it is clamped to the frame.
    size_wh : (2,) float64
        The candidate's size, stabilized pixels.
    score : float
        The candidate's foreground probability (softmax), 0..1.
    cell : (int, int)
        Row and column of the response map.
    crop_side : int
        Side of the search region, stabilized pixels.
    features : list of ndarray
        The outputs of the search network after the first two.
    """

    state: TargetState
    size_wh: Floats
    score: float
    cell: tuple[int, int]
    crop_side: int
    features: list[Tensor]


@dataclass
class AnchorTarget:
    """State of the target of `SiamRpn` and `SiamMask`."""

    state: TargetState
    kernels: list[Tensor]
    fill: Floats  # color outside of the frame, BGR
    distractors: DistractorTracker


class SiamRpn(SiameseTracker[AnchorTarget]):
    """SiamRPN's loop.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    networks : SiamRpnNetworks
    parameters : SiamRpnParameters
    distractors : bool
        Whether objects like the target are recognized by their positions.
    """

    score_is_calibrated = False

    def __init__(
        self,
        networks: SiamRpnNetworks,
        parameters: SiamRpnParameters,
        *,
        distractors: bool = False,
    ) -> None:
        super().__init__(distractors)
        self._networks = networks
        self._parameters = parameters
        pysot = parameters.variant == "pysot"
        self.center_inset = 1.0 if pysot else 0.0
        self._crop: Crop = pysot_crop if pysot else siammask_crop
        self._anchors = anchor_boxes(parameters.side)
        self._window: Floats = np.tile(cosine_window(parameters.side), ANCHORS)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; crops are padded with the frame's mean color."""
        if self._parameters.variant == "pysot":
            state = TargetState.from_xywh(xywh)
        else:
            state = TargetState.from_reported_xywh(xywh)
        fill: Floats = mean_color(view.raw)
        crop = self._crop(view, state.center_xy, round(state.context_side), TEMPLATE_SIDE, fill)
        kernels = self._networks.template(crop_tensor(crop))
        self._start(AnchorTarget(state, kernels, fill, DistractorTracker(self._has_distractors)))

    def update(self, view: FrameView) -> Track:
        """The target in the next view; its score is the chosen candidate's softmax.

        The sides of the box are at least 10 pixels. If the candidate is smaller, the score is
        multiplied by the maximum IoU of such a box with it.
        """
        found = self._best_candidate(view)
        state = self._target.state = clamped_state(found.state, view)
        return Track(state.xywh, score=found.score * min_size_iou(state, found.size_wh))

    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64."""
        return flattened(self._target.kernels)

    def move_to(self, xywh: XYWH) -> None:
        """Search around `xywh`, the view's pixels, from now on."""
        self._target.state = TargetState.from_reported_xywh(xywh)
        self._target.distractors = DistractorTracker(self._has_distractors)

    def _best_candidate(self, view: FrameView) -> Candidate:
        """The best candidate in the search region around the last state."""
        target, parameters = self._target, self._parameters
        state = target.state
        zoom = TEMPLATE_SIDE / state.context_side
        side = round(parameters.instance / zoom)
        crop = self._crop(view, state.center_xy, side, parameters.instance, target.fill)
        scores, regression, *features = self._networks.search(crop_tensor(crop), *target.kernels)
        score = foreground_probability(scores)
        boxes = decode(regression, self._anchors)
        size = np.array(state.size_wh) * zoom
        positions_xy = boxes[:2].T / zoom + state.center_xy
        candidates = target.distractors.detect(positions_xy, score, state, ANCHORS)
        best, penalty = select_candidate(
            boxes, candidates.allowed_score, size, self._window, parameters
        )
        target.distractors.update(candidates, best)
        rate = penalty * score[best] * parameters.lr
        return Candidate(
            updated_state(state, boxes[:, best], zoom, rate),
            boxes[2:, best] / zoom,
            float(score[best]),
            cell_of(best, parameters.side),
            side,
            features,
        )
