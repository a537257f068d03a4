"""The small tracker trained here: an anchor-free search, and a mask of the target.

The loop is that of the Siamese trackers; the score is the probability that a cell lies on the
target times the overlap that its box is expected to have. Unlike theirs it has no half pixels of
asymmetry: centres are those of the boxes, x + w / 2, and crops count from where they were cut.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from ssiam.copying import DeepCopied
from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.runtime import Network, RuntimeOptions, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.lite_mask import crop_corner, pasted, turned_box
from ssiam.trackers.rivals import Rivals
from ssiam.trackers.siamese import (
    EXEMPLAR,
    Floats,
    SearchParameters,
    TargetState,
    choose,
    cosine_window,
    crop_tensor,
    floor_overlap,
    moved,
    sigmoid,
    smallest_size,
    state_at,
)

LiteName: TypeAlias = Literal["lite"]
SHIPPED: Final = Path(__file__).parents[1] / "models" / "lite"

SEARCH: Final = 255  # px, side of the search crop
_STRIDE: Final = 8  # px between cells
_SIDE: Final = 32  # cells
_LOGITS: Final = (-8.0, 8.0)  # beyond these a score says no more

# From benchmarks/calibration/search_parameters.py, on videos that training left out.
PARAMETERS: Final = SearchParameters(penalty_k=0.1, window_influence=0.1, lr=0.6)
CONFIDENCE: Final = Confidence((1.61, 1.02), -0.92)  # from benchmarks/calibration/confidence.py
MASK_THRESHOLD: Final = 0.2  # from benchmarks/calibration/mask_threshold.py


@dataclass(frozen=True)
class LiteNetworks:
    """The networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` (1, 3, 127, 127) float32 BGR in 0..255 -> kernel (1, 64, 96); `search`
    (1, 3, 255, 255) and the kernel -> logits of score and quality (1, 1, 32, 32), distances
    (1, 4, 32, 32) in px, and logits of the mask (1, 1, 64, 64).
    """

    template: Network
    search: Network

    @classmethod
    def load(cls, weights: Path, running: RuntimeOptions) -> LiteNetworks:
        """The networks of a folder that `ssiam train` has written.

        Raises
        ------
        WeightsError
            They are missing, damaged or of another network.
        ArgumentError
            They cannot run so.
        """
        from ssiam.runtime.loading import load_pieces

        if running.runtime == "torch":
            raise ArgumentError("tracker lite is in ONNX: choose runtime openvino or onnxruntime")
        if running.precision == "int8":
            raise ArgumentError("tracker lite has no int8 weights: leave precision out")
        pieces = load_pieces(weights, "lite", running)
        return cls(pieces["template"], pieces["search"])


class LiteTracker(DeepCopied):
    """The loop on any frame view.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    networks : LiteNetworks
    parameters : SearchParameters
    confidence : Confidence
        Of the logits of the chosen cell's score and quality.
    masks : bool
        Without, there are neither masks nor rotated boxes.
    mask_threshold : float
        Probability above which a pixel is the target's: less than a half, as the overlap (IoU) is
        best where doubtful pixels count.
    """

    doubt = 0.0

    def __init__(
        self,
        networks: LiteNetworks,
        parameters: SearchParameters = PARAMETERS,
        confidence: Confidence = CONFIDENCE,
        *,
        masks: bool = True,
        mask_threshold: float = MASK_THRESHOLD,
    ) -> None:
        self._networks = networks
        self._parameters = parameters
        self._confidence = confidence
        self._masks = masks
        self._mask_threshold = mask_threshold
        self._window = cosine_window(_SIDE)
        middles = (np.arange(_SIDE) - (_SIDE - 1) / 2) * _STRIDE
        self._middles = np.stack(np.meshgrid(middles, middles)).reshape(2, -1)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; its surroundings' mean colour fills what is outside."""
        state, fill = state_at(xywh), view.raw.mean(axis=(0, 1))
        crop = view.crop(state.center_xy, round(state.context_side), EXEMPLAR, fill)
        (kernel,) = self._networks.template(crop_tensor(crop))
        self._state, self._fill, self._kernel = state, fill, kernel
        self._floor_wh = smallest_size(state.size_wh)
        self._rivals = Rivals()

    def track(self, view: FrameView) -> Track:
        """The target in the next view, with mask and corners if they are wanted."""
        last = self._state
        side = round(SEARCH / EXEMPLAR * last.context_side)
        zoom = SEARCH / side
        crop = view.crop(last.center_xy, side, SEARCH, self._fill)
        scores, qualities, distances, mask_logits = self._networks.search(
            crop_tensor(crop), self._kernel
        )
        score = sigmoid(scores) * sigmoid(qualities)
        boxes = self._boxes(distances)
        boxes[:2] += self._off(last, side)[:, None] * zoom
        size = np.array(last.size_wh) * zoom
        taken = self._rivals.taken(boxes[:2].T / zoom + last.center_xy, score, last)
        best, penalty = choose(
            boxes, np.where(taken, -1.0, score), size, self._window, self._parameters
        )
        self._rivals.follow(best)
        rate = penalty * score[best] * self._parameters.lr
        self._state = moved(last, boxes[:, best], zoom, rate, view, self._floor_wh)
        logits = (float(maps.ravel()[best]) for maps in (scores, qualities))
        evidence = tuple(float(np.clip(logit, *_LOGITS)) for logit in logits)
        probability = self._confidence.probability(evidence)
        probability *= floor_overlap(self._state, boxes[2:, best] / zoom, self._floor_wh)
        found = Track(self._state.xywh, probability, evidence=evidence)
        return self._masked(found, mask_logits, view, last, side) if self._masks else found

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, looked for around `xywh`."""
        self._state = state_at(xywh)
        self._rivals = Rivals()
        return self.track(view)

    def another(self) -> LiteTracker:
        """A second tracker on the same networks."""
        return LiteTracker(
            self._networks,
            self._parameters,
            self._confidence,
            masks=self._masks,
            mask_threshold=self._mask_threshold,
        )

    @staticmethod
    def _off(last: TargetState, side: int) -> Floats:
        """How far (2,) the middle of the search crop lies from the last centre, view's pixels."""
        return crop_corner(last.center_xy, side) + side / 2 - last.center_xy

    def _boxes(self, distances: Tensor) -> Floats:
        """Candidates (4, n): cx, cy, w, h in search pixels from the search region's centre."""
        left, top, right, bottom = distances[0].reshape(4, -1).astype(np.float64)
        x, y = self._middles
        return np.stack(
            [x + (right - left) / 2, y + (bottom - top) / 2, left + right, top + bottom]
        )

    def _masked(
        self, found: Track, logits: Tensor, view: FrameView, last: TargetState, side: int
    ) -> Track:
        """With the mask in the view's pixels, and its rotated box if that agrees with the box."""
        # A steadied view shows parts of the raw frame beyond its own edges.
        margin = 0 if view.is_raw else view.border
        least = math.log(self._mask_threshold / (1 - self._mask_threshold))
        mask = pasted(logits - least, last.center_xy, side, found.box, view.size_wh, margin)
        corners = turned_box(mask, found.box)
        return replace(found, mask=mask.inside(view.size_wh), corners=corners)
