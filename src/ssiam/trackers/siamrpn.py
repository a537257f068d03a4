"""SiamRPN and SiamRPN++: the best of a grid of anchor boxes, on any frame view.

The loop is that of STVIR/pysot (Li et al., SiamRPN, CVPR 2018; SiamRPN++, CVPR 2019), or that of
foolwood/SiamMask where the two differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from ssiam.copying import DeepCopied
from ssiam.geometry import XYWH
from ssiam.runtime import Network, Tensor
from ssiam.stabilize import FrameView
from ssiam.stabilize.view import Color
from ssiam.track import Track
from ssiam.trackers.anchors import ANCHORS, anchor_boxes, cell_of, decode, response_side
from ssiam.trackers.crops import Crop, pysot_crop, siammask_crop
from ssiam.trackers.siamese import (
    EXEMPLAR,
    Floats,
    SearchParameters,
    TargetState,
    choose,
    cosine_window,
    crop_tensor,
    floor_overlap,
    followed,
    foreground,
    kept_inside,
    state_at,
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
    """What steers a tracker with anchors; the names of pysot's configuration in brackets.

    Parameters
    ----------
    penalty_k, window_influence, lr : float
        As `SearchParameters`.
    instance : int
        Side of the search crop, pixels (INSTANCE_SIZE).
    base : int
        Cells of the response map beyond those of a network without padding (BASE_SIZE).
    variant : {"pysot", "siammask"}
        Whose loop decides on half pixels. The SiamMask authors' one takes a first box's centre at
        x + w / 2 (not x + (w - 1) / 2), and rounds the corners of crops half to even.
    """

    instance: int = 255
    base: int = 8
    variant: Variant = "pysot"

    @property
    def side(self) -> int:
        """Cells of the response map's side."""
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

    `template` takes (1, 3, 127, 127) float32 BGR in 0..255 and gives any list of arrays; `search`
    takes (1, 3, S, S) of the same kind and those arrays, and gives the raw maps (1, 10, n, n) of
    scores, background first, and (1, 20, n, n) of distances; what follows them is passed on.
    """

    template: Network
    search: Network


@dataclass(frozen=True, eq=False)
class Found:
    """The best candidate in one search region.

    `state` is where the target is now, not yet kept inside of the frame; `size_wh` (2,) the
    candidate's own size in steadied pixels; `cell` the row and
    column of the response map; `crop_side` the side of the region in steadied pixels; `more` the
    network's outputs after the first two.
    """

    state: TargetState
    size_wh: Floats
    score: float
    cell: tuple[int, int]
    crop_side: int
    more: list[Tensor]


class AnchorSearch:
    """A template, and the search for it around a place: what SiamRPN and SiamMask share.

    Parameters
    ----------
    networks : SiamRpnNetworks
    parameters : SiamRpnParameters
    """

    def __init__(self, networks: SiamRpnNetworks, parameters: SiamRpnParameters) -> None:
        self._networks = networks
        self._parameters = parameters
        self._crop: Crop = pysot_crop if parameters.variant == "pysot" else siammask_crop
        self._anchors = anchor_boxes(parameters.side)
        self._window: Floats = np.tile(cosine_window(parameters.side), ANCHORS)

    def start(self, view: FrameView, xywh: XYWH) -> TargetState:
        """Take the template from `xywh`; its surroundings' mean colour fills what is outside."""
        state = self._state(xywh)
        fill: Color = view.raw.mean(axis=(0, 1))
        crop = self._crop(view, state.center_xy, round(state.context_side), EXEMPLAR, fill)
        self._kernels, self._fill = self._networks.template(crop_tensor(crop)), fill
        return state

    def find(self, view: FrameView, state: TargetState) -> Found:
        """The best candidate around the last `state`."""
        parameters = self._parameters
        zoom = EXEMPLAR / state.context_side
        side = round(parameters.instance / zoom)
        crop = self._crop(view, state.center_xy, side, parameters.instance, self._fill)
        scores, distances, *more = self._networks.search(crop_tensor(crop), *self._kernels)
        score = foreground(scores)
        boxes = decode(distances, self._anchors)
        size = np.array(state.size_wh) * zoom
        best, penalty = choose(boxes, score, size, self._window, parameters)
        rate = penalty * score[best] * parameters.lr
        after = followed(state, boxes[:, best], zoom, rate)
        seen = boxes[2:, best] / zoom
        return Found(after, seen, float(score[best]), cell_of(best, parameters.side), side, more)

    def _state(self, xywh: XYWH) -> TargetState:
        if self._parameters.variant == "pysot":
            return TargetState.from_xywh(xywh)
        return state_at(xywh)


class SiamRpn(DeepCopied):
    """SiamRPN's loop.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    networks : SiamRpnNetworks
    parameters : SiamRpnParameters
    """

    doubt = 0.0

    def __init__(self, networks: SiamRpnNetworks, parameters: SiamRpnParameters) -> None:
        self._networks = networks
        self._parameters = parameters
        self._search = AnchorSearch(networks, parameters)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the target in `xywh` as the one to follow."""
        self._state = self._search.start(view, xywh)

    def track(self, view: FrameView) -> Track:
        """The target in the next view; its score is the chosen candidate's softmax.

        Where the box is larger than the candidate, as it is never below 10 pixels, the score is
        less: times the overlap that the box can have.
        """
        found = self._search.find(view, self._state)
        self._state = kept_inside(found.state, view)
        score = found.score * floor_overlap(self._state, found.size_wh)
        return Track(self._state.xywh, score=score)

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, looked for around `xywh`."""
        self._state = state_at(xywh)
        return self.track(view)

    def another(self) -> SiamRpn:
        """A second tracker on the same networks."""
        return SiamRpn(self._networks, self._parameters)
