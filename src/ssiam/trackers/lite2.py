"""The loop of `lite`'s second network: anchor-free, with a memory of the target's recent look.

The loop is that of the Siamese trackers; the score is the probability that a cell lies on the
target times the overlap that its box is expected to have. Centers are those of the boxes,
x + w / 2, and crops count from where they were cut, as in `ssiam.trackers.lite`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH
from ssiam.runtime import Network, RuntimeOptions, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.lite_mask import crop_corner
from ssiam.trackers.rivals import Rivals
from ssiam.trackers.siamese import (
    EXEMPLAR,
    Floats,
    SearchParameters,
    choose,
    cosine_window,
    crop_tensor,
    moved,
    sigmoid,
    state_at,
)

SEARCH: Final = 255  # px, side of the search crop
_STRIDE: Final = 16  # px between cells
_SIDE: Final = 15  # cells
_LOGITS: Final = (-8.0, 8.0)  # beyond these a score says no more

PARAMETERS: Final = SearchParameters(penalty_k=0.138, window_influence=0.3, lr=0.4)
CONFIDENCE: Final = Confidence((1.0, 0.5), -1.0)


@dataclass(frozen=True)
class Memory:
    """When the recent template is taken anew.

    Attributes
    ----------
    every : int
        Frames from one to the next, at least; 0: there is only the first template.
    score : float
        Score 0..1 of the chosen cell from which the target is surely seen.
    alone : float
        Share 0..1 of that score which no cell off the target may exceed.
    """

    every: int = 10
    score: float = 0.6
    alone: float = 0.5


MEMORY: Final = Memory()


@dataclass(frozen=True)
class Lite2Networks:
    """The networks, which any number of trackers may share.

    `template` (1, 3, 127, 127) float32 BGR in 0..255 -> the kernels of
    `ssiam.networks.lite2.Lite2Network.template`, their context last; `search` (1, 3, 255, 255),
    the kernels and the context of a recent template -> logits of score and quality
    (1, 1, 15, 15), distances (1, 4, 15, 15) in px.
    """

    template: Network
    search: Network

    @classmethod
    def load(cls, weights: Path, running: RuntimeOptions) -> Lite2Networks:
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
        pieces = load_pieces(weights, "lite2", running)
        return cls(pieces["template"], pieces["search"])

    def responses(self, crop: Tensor, kernels: list[Tensor], recent: Tensor) -> list[Tensor]:
        """Responses of a search crop; a network without attention takes no context."""
        inputs = crop, *kernels, recent
        return self.search(*inputs[: len(self.search.input_shapes) or None])


class Lite2Tracker:
    """The loop on any frame view.

    Parameters
    ----------
    networks : Lite2Networks
    parameters : SearchParameters
    confidence : Confidence
        Of the logits of the chosen cell's score and quality.
    memory : Memory
    """

    doubt = 0.0

    def __init__(
        self,
        networks: Lite2Networks,
        parameters: SearchParameters = PARAMETERS,
        confidence: Confidence = CONFIDENCE,
        memory: Memory = MEMORY,
    ) -> None:
        self._networks = networks
        self._parameters = parameters
        self._confidence = confidence
        self._memory = memory
        self._window = cosine_window(_SIDE)
        offsets = (np.arange(_SIDE) - _SIDE // 2) * float(_STRIDE)
        self._points = np.stack(np.meshgrid(offsets, offsets)).reshape(2, -1)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; its surroundings' mean color fills what is outside."""
        self._state = state_at(xywh)
        self._rivals = Rivals()
        self._fill: Floats = view.raw.mean(axis=(0, 1))
        self._kernels = self._template(view)
        self._forget()

    def track(self, view: FrameView) -> Track:
        """The target in the next view."""
        last = self._state
        side = round(SEARCH / EXEMPLAR * last.context_side)
        zoom = SEARCH / side
        crop = view.crop(last.center_xy, side, SEARCH, self._fill)
        scores, qualities, distances = self._networks.responses(
            crop_tensor(crop), self._kernels, self._recent
        )
        score = sigmoid(scores) * sigmoid(qualities)
        boxes = self._boxes(distances)
        corner = crop_corner(last.center_xy, side)
        boxes[:2] += (corner + side / 2 - last.center_xy)[:, None] * zoom
        size = np.array(last.size_wh) * zoom
        taken = self._rivals.taken(boxes[:2].T / zoom + last.center_xy, score, last)
        best, penalty = choose(
            boxes, np.where(taken, -1.0, score), size, self._window, self._parameters
        )
        self._rivals.follow(best)
        rate = penalty * score[best] * self._parameters.lr
        self._state = moved(last, boxes[:, best], zoom, rate, view)
        self._remember(view, boxes, score, best)
        logits = (float(maps.ravel()[best]) for maps in (scores, qualities))
        evidence = tuple(float(np.clip(logit, *_LOGITS)) for logit in logits)
        return Track(self._state.xywh, self._confidence.probability(evidence), evidence=evidence)

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, looked for around `xywh`."""
        self._state = state_at(xywh)
        self._rivals = Rivals()
        self._forget()
        return self.track(view)

    def another(self) -> Lite2Tracker:
        """A second tracker on the same networks."""
        return Lite2Tracker(self._networks, self._parameters, self._confidence, self._memory)

    def _template(self, view: FrameView) -> list[Tensor]:
        """Kernels and context of the target as it is now."""
        side = round(self._state.context_side)
        crop = view.crop(self._state.center_xy, side, EXEMPLAR, self._fill)
        return self._networks.template(crop_tensor(crop))

    def _forget(self) -> None:
        """Only the first template counts from now on."""
        self._recent, self._age = self._kernels[-1], 0

    def _remember(self, view: FrameView, boxes: Floats, score: Floats, best: int) -> None:
        """Take the recent template where the target is surely seen, and nothing like it."""
        self._age += 1
        memory = self._memory
        if not memory.every or self._age < memory.every or score[best] < memory.score:
            return
        off = np.abs(boxes[:2] - boxes[:2, best : best + 1]) > boxes[2:, best : best + 1] / 2
        others = score[off.any(axis=0)]
        if not len(others) or others.max() < memory.alone * score[best]:
            self._recent, self._age = self._template(view)[-1], 0

    def _boxes(self, distances: Tensor) -> Floats:
        """Candidates (4, n): cx, cy, w, h in search pixels from the search region's center."""
        left, top, right, bottom = distances[0].reshape(4, -1).astype(np.float64)
        x, y = self._points
        return np.stack(
            [x + (right - left) / 2, y + (bottom - top) / 2, left + right, top + bottom]
        )
