"""NanoTrack v1, v2 and v3: a small anchor-free Siamese tracker for CPUs.

Networks and weights are the authors' (github.com/HonglinChu/SiamTrackers, Apache-2.0), as ONNX:
a backbone that is run on template and search region, and a head that compares the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from ssiam.errors import WeightsError
from ssiam.geometry import XYWH
from ssiam.runtime import Network, Precision, Running, Tensor, load_network
from ssiam.stabilize import FrameView
from ssiam.trackers.confidence import Confidence, Usual, look
from ssiam.trackers.siamese import (
    EXEMPLAR,
    Floats,
    SearchParameters,
    TargetState,
    choose,
    cosine_window,
    crop_tensor,
    foreground,
    moved,
    state_at,
)
from ssiam.trackers.track import Track

NanoTrackName: TypeAlias = Literal["nanotrack_v1", "nanotrack_v2", "nanotrack_v3"]

_SEARCH: Final = 255  # px, side of the search crop
_STRIDE: Final = 16  # px between points of the response map
_LOGITS: Final = (-6.0, 12.0)  # beyond these a score says no more
_SURE: Final = 8.0  # logit from which it does not matter what the target looks like
_UNSURE: Final = 4.0  # by how much a logit is below that where it matters wholly
_KNOWN: Final = 6.0  # logit from which the target has come to look as it does
_HEAD_CONVOLUTIONS: Final[dict[NanoTrackName, int]] = {  # v1 and v2 have the same shapes
    "nanotrack_v1": 18,
    "nanotrack_v2": 34,
    "nanotrack_v3": 46,
}

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


@dataclass(frozen=True)
class NanoTrackNetworks:
    """The three compiled networks, which any number of trackers may share.

    `template` (1, 3, 127, 127) and `search` (1, 3, 255, 255) are one backbone; `head` takes the
    features of both and gives scores (1, 2, n, n) and distances (1, 4, n, n).
    """

    template: Network
    search: Network
    head: Network

    @classmethod
    def load(cls, name: NanoTrackName, weights: Path, running: Running) -> NanoTrackNetworks:
        """Networks from the folder that holds the two ONNX files, or from one of the two.

        With precision "int8" the backbone must be quantised, and the head may be. Raises
        `WeightsError` when they are missing, damaged, not quantised, or of another network.
        """
        backbone, head = _onnx_pair(weights)

        def compiled(
            path: Path, precision: Precision, shape: tuple[int, ...] | None = None
        ) -> Network:
            return load_network(
                path,
                shape,
                runtime=running.runtime,
                threads=running.threads,
                precision=precision,
                device=running.device,
            )

        networks = cls(
            compiled(backbone, running.precision, (1, 3, EXEMPLAR, EXEMPLAR)),
            compiled(backbone, running.precision, (1, 3, _SEARCH, _SEARCH)),
            compiled(head, "f32" if running.precision == "int8" else running.precision),
        )
        networks._check(name, weights)
        return networks

    def _check(self, name: NanoTrackName, weights: Path) -> None:
        features = [self.template.output_shapes, self.search.output_shapes]
        channels, side = (96, 15) if name == "nanotrack_v3" else (48, 16)
        wanted_features = [[(1, channels, 8, 8)], [(1, channels, 16, 16)]]
        wanted_maps = [(1, 2, side, side), (1, 4, side, side)]
        if (
            features != wanted_features
            or self.head.input_shapes != [shapes[0] for shapes in wanted_features]
            or self.head.output_shapes != wanted_maps
            or self.head.convolutions != _HEAD_CONVOLUTIONS[name]
        ):
            raise WeightsError(
                f"{weights} holds weights of another network than {name}: "
                f"features {features[1][0]}, maps {self.head.output_shapes}, "
                f"{self.head.convolutions} convolutions in the head; wanted "
                f"{wanted_features[1][0]}, {wanted_maps}, {_HEAD_CONVOLUTIONS[name]}"
            )


class NanoTrack:
    """NanoTrack's loop on any frame view.

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
        self._state = TargetState.from_xywh(xywh)
        self._fill: Floats = view.raw.mean(axis=(0, 1))
        side = round(self._state.context_side)
        crop = view.crop(self._state.centre_xy, side, EXEMPLAR, self._fill)
        (self._template,) = self._networks.template(crop_tensor(crop))
        size = np.array(self._state.size_wh) * EXEMPLAR / self._state.context_side
        self._usual = Usual()
        self._first_look = look(self._template, _STRIDE, np.array([0, 0, *size]))

    def track(self, view: FrameView) -> Track:
        """The target in the next view."""
        zoom = EXEMPLAR / self._state.context_side
        crop = view.crop(self._state.centre_xy, round(_SEARCH / zoom), _SEARCH, self._fill)
        (features,) = self._networks.search(crop_tensor(crop))
        score_maps, distances = self._networks.head(self._template, features)
        score = foreground(score_maps)
        boxes = self._boxes(distances)
        size = np.array(self._state.size_wh) * zoom
        best, penalty = choose(boxes, score, size, self._window, self._parameters)
        rate = penalty * score[best] * self._parameters.lr
        self._state = moved(self._state, boxes[:, best], zoom, rate, view)
        background, target = score_maps[0].reshape(2, -1)[:, best]
        likeness = float(self._first_look @ look(features, _STRIDE, boxes[:, best]))
        logit = float(np.clip(target - background, *_LOGITS))
        doubt = float(np.clip((_SURE - logit) / _UNSURE, 0, 1))
        shortfall = self._usual.shortfall(likeness, sure=logit > _KNOWN)
        evidence = logit, doubt * shortfall
        probability = self._confidence.probability(evidence)
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


def _onnx_pair(weights: Path) -> tuple[Path, Path]:
    """The backbone's and the head's file in a folder, or beside one of them."""
    folder = weights if weights.is_dir() else weights.parent
    if not weights.exists():
        raise WeightsError(
            f"weights {weights} do not exist: give the folder of NanoTrack's two .onnx files"
        )
    if weights.is_file() and weights.suffix != ".onnx":
        raise WeightsError(f"weights {weights} are not an .onnx file: NanoTrack runs from ONNX")
    found = []
    for part in ("backbone", "head"):
        files = sorted(folder.glob(f"*{part}*.onnx"))
        if len(files) != 1:
            raise WeightsError(
                f"weights folder {folder} holds {len(files)} files named *{part}*.onnx, "
                "NanoTrack needs exactly one"
            )
        found.append(files[0])
    return found[0], found[1]
