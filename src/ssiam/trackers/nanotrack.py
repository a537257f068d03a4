"""NanoTrack v1, v2 and v3: a small anchor-free Siamese tracker for CPUs.

Networks and weights are the authors' (github.com/HonglinChu/SiamTrackers, Apache-2.0), as ONNX:
a backbone that is run on template and search region, and a head that compares the two.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ssiam.copying import DeepCopied
from ssiam.geometry import XYWH
from ssiam.runtime import Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.confidence import Confidence, Usual, look
from ssiam.trackers.nanotrack_networks import SEARCH, NanoTrackName, NanoTrackNetworks
from ssiam.trackers.siamese import (
    EXEMPLAR,
    Floats,
    SearchParameters,
    TargetState,
    choose,
    cosine_window,
    crop_tensor,
    floor_overlap,
    foreground,
    moved,
    smallest_size,
    state_at,
)

_STRIDE: Final = 16  # px between points of the response map
_LOGITS: Final = (-6.0, 12.0)  # beyond these a score says no more
_SURE: Final = 8.0  # logit from which it does not matter what the target looks like
_UNSURE: Final = 4.0  # by how much a logit is below that where it matters wholly
_KNOWN: Final = 6.0  # logit from which the target has come to look as it does

PARAMETERS: Final[dict[NanoTrackName, SearchParameters]] = {
    "nanotrack_v1": SearchParameters(penalty_k=0.148, window_influence=0.462, lr=0.390),
    "nanotrack_v2": SearchParameters(penalty_k=0.150, window_influence=0.490, lr=0.385),
    "nanotrack_v3": SearchParameters(penalty_k=0.138, window_influence=0.455, lr=0.348),
}

CONFIDENCE: Final[dict[NanoTrackName, Confidence]] = {  # of logit and shortfall
    "nanotrack_v1": Confidence((0.44, 26.0), -0.9),
    "nanotrack_v2": Confidence((0.81, 23.0), -3.5),
    "nanotrack_v3": Confidence((0.48, 31.0), -1.9),
}


class NanoTrack(DeepCopied):
    """NanoTrack's loop on any frame view.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Unlike in the authors' loop a box may be smaller than 10 pixels, if the first one was smaller
    than 20: half of that one, but no less.

    Parameters
    ----------
    networks : NanoTrackNetworks
    parameters : SearchParameters
    confidence : Confidence
        Of the chosen candidate's logit, and by how much its features are less like the template's
        than usual.
    """

    doubt = 0.0

    def __init__(
        self, networks: NanoTrackNetworks, parameters: SearchParameters, confidence: Confidence
    ) -> None:
        self._networks = networks
        self._parameters = parameters
        self._confidence = confidence
        side = networks.head.output_shapes[0][-1]
        self._window = cosine_window(side)
        offsets = (np.arange(side) - side // 2) * float(_STRIDE)
        self._points = np.stack(np.meshgrid(offsets, offsets)).reshape(2, -1)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; its surroundings' mean colour fills what is outside."""
        state, fill = TargetState.from_xywh(xywh), view.raw.mean(axis=(0, 1))
        crop = view.crop(state.center_xy, round(state.context_side), EXEMPLAR, fill)
        (template,) = self._networks.template(crop_tensor(crop))
        size = np.array(state.size_wh) * EXEMPLAR / state.context_side
        self._first_look = look(template, _STRIDE, np.array([0, 0, *size]))
        self._state, self._fill, self._template = state, fill, template
        self._usual = Usual()
        self._floor_wh = smallest_size(state.size_wh)

    def track(self, view: FrameView) -> Track:
        """The target in the next view."""
        zoom = EXEMPLAR / self._state.context_side
        crop = view.crop(self._state.center_xy, round(SEARCH / zoom), SEARCH, self._fill)
        (features,) = self._networks.search(crop_tensor(crop))
        score_maps, distances = self._networks.head(self._template, features)
        score = foreground(score_maps)
        boxes = self._boxes(distances)
        size = np.array(self._state.size_wh) * zoom
        best, penalty = choose(boxes, score, size, self._window, self._parameters)
        rate = penalty * score[best] * self._parameters.lr
        self._state = moved(self._state, boxes[:, best], zoom, rate, view, self._floor_wh)
        background, target = score_maps[0].reshape(2, -1)[:, best]
        likeness = float(self._first_look @ look(features, _STRIDE, boxes[:, best]))
        logit = float(np.clip(target - background, *_LOGITS))
        doubt = float(np.clip((_SURE - logit) / _UNSURE, 0, 1))
        shortfall = self._usual.shortfall(likeness, sure=logit > _KNOWN)
        evidence = logit, doubt * shortfall
        probability = self._confidence.probability(evidence)
        probability *= floor_overlap(self._state, boxes[2:, best] / zoom, self._floor_wh)
        return Track(self._state.xywh, score=probability, evidence=evidence)

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, looked for around `xywh`."""
        self._state = state_at(xywh)
        return self.track(view)

    def another(self) -> NanoTrack:
        """A second tracker on the same networks."""
        return NanoTrack(self._networks, self._parameters, self._confidence)

    def _boxes(self, distances: Tensor) -> Floats:
        """Candidates (4, n): cx, cy, w, h in search pixels from the search region's centre."""
        left, top, right, bottom = distances[0].reshape(4, -1).astype(np.float64)
        x, y = self._points
        return np.stack(
            [x + (right - left) / 2, y + (bottom - top) / 2, left + right, top + bottom]
        )
