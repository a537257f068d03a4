"""NanoTrack v1, v2 and v3: small anchor-free Siamese trackers for CPUs.

The networks and weights are the authors' ONNX files (github.com/HonglinChu/SiamTrackers,
Apache-2.0): a backbone for template and search crop, and a head that compares their features.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from ssiam.errors import WeightsError
from ssiam.geometry import XYWH
from ssiam.runtime import Network, Precision, RuntimeOptions, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.candidates import CandidateTracker, Details
from ssiam.trackers.confidence import Confidence, RunningBaseline, box_feature
from ssiam.trackers.distractors import DistractorTracker
from ssiam.trackers.responses import Response
from ssiam.trackers.siamese import (
    TEMPLATE_SIDE,
    Floats,
    SearchParameters,
    TargetState,
    boxes_from_distances,
    boxes_in_view,
    cosine_window,
    crop_tensor,
    flattened,
    foreground_probability,
    grid_points,
    min_size,
    min_size_iou,
    next_state,
)

NanoTrackName: TypeAlias = Literal["nanotrack_v1", "nanotrack_v2", "nanotrack_v3"]

SEARCH_SIDE: Final = 255  # px, side of the search crop
_STRIDE: Final = 16  # px between points of the response map
_HEAD_CONVOLUTIONS: Final[dict[NanoTrackName, int]] = {  # distinguishes v1 and v2
    "nanotrack_v1": 18,
    "nanotrack_v2": 34,
    "nanotrack_v3": 46,
}
_LOGIT_RANGE: Final = (-6.0, 12.0)  # to which the evidence is clipped
_CERTAIN_LOGIT: Final = 8.0  # logit from which the similarity to the template has no weight
_LOGIT_SPAN: Final = 4.0  # decrease of the logit over which that weight rises from 0 to 1
_BASELINE_LOGIT: Final = 6.0  # logit above which any similarity updates the baseline

PARAMETERS: Final[dict[NanoTrackName, SearchParameters]] = {
    "nanotrack_v1": SearchParameters(penalty_k=0.148, window_influence=0.462, lr=0.390),
    "nanotrack_v2": SearchParameters(penalty_k=0.150, window_influence=0.490, lr=0.385),
    "nanotrack_v3": SearchParameters(penalty_k=0.138, window_influence=0.455, lr=0.348),
}

CONFIDENCE: Final[dict[NanoTrackName, Confidence]] = {  # of logit and similarity drop
    "nanotrack_v1": Confidence((0.44, 26.0), -0.9),
    "nanotrack_v2": Confidence((0.81, 23.0), -3.5),
    "nanotrack_v3": Confidence((0.48, 31.0), -1.9),
}

# Whose candidates are ranked by the prediction too; on the videos that decide, v1 loses by it
# (docs/decisions/0013-candidates-near-the-prediction.md).
PREFERRING: Final[tuple[NanoTrackName, ...]] = ("nanotrack_v3",)


@dataclass(frozen=True)
class NanoTrackNetworks:
    """The three compiled networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` and `search` are one backbone, compiled for crops (1, 3, 127, 127) and
    (1, 3, 255, 255), float32 BGR in 0..255. `head` maps the features of both to scores
    (1, 2, n, n), background first, and distances (1, 4, n, n) in px of the search crop.
    """

    template: Network
    search: Network
    head: Network

    @classmethod
    def load(cls, name: NanoTrackName, weights: Path, options: RuntimeOptions) -> NanoTrackNetworks:
        """Load the networks.

        Parameters
        ----------
        name : {"nanotrack_v1", "nanotrack_v2", "nanotrack_v3"}
        weights : Path
            The folder of the two .onnx files, or one of these files.
        options : RuntimeOptions
            With precision "int8" the backbone must be quantized, and the head may be.

        Raises
        ------
        WeightsError
            The files are missing, damaged, of another network, or not in int8 as requested.
        """
        from ssiam.runtime.loading import load_network

        backbone, head = onnx_pair(weights)

        def compiled(
            path: Path, precision: Precision, shape: tuple[int, ...] | None = None
        ) -> Network:
            return load_network(
                path,
                shape,
                runtime=options.runtime,
                threads=options.threads,
                precision=precision,
                device=options.device,
            )

        networks = cls(
            compiled(backbone, options.precision, (1, 3, TEMPLATE_SIDE, TEMPLATE_SIDE)),
            compiled(backbone, options.precision, (1, 3, SEARCH_SIDE, SEARCH_SIDE)),
            compiled(head, "f32" if options.precision == "int8" else options.precision),
        )
        networks._check(name, weights)
        return networks

    def _check(self, name: NanoTrackName, weights: Path) -> None:
        features = [self.template.output_shapes, self.search.output_shapes]
        channels, side = (96, 15) if name == "nanotrack_v3" else (48, 16)
        expected_features = [[(1, channels, 8, 8)], [(1, channels, 16, 16)]]
        expected_maps = [(1, 2, side, side), (1, 4, side, side)]
        if (
            features != expected_features
            or self.head.input_shapes != [shapes[0] for shapes in expected_features]
            or self.head.output_shapes != expected_maps
            or self.head.convolution_count != _HEAD_CONVOLUTIONS[name]
        ):
            raise WeightsError(
                f"{weights} holds weights of another network than {name}: "
                f"features {features[1][0]}, maps {self.head.output_shapes}, "
                f"{self.head.convolution_count} convolutions in the head; expected "
                f"{expected_features[1][0]}, {expected_maps}, {_HEAD_CONVOLUTIONS[name]}"
            )


@dataclass
class _Target:
    """State of the target."""

    state: TargetState
    min_wh: tuple[float, float]
    kernel: Tensor
    feature: Floats  # of the template
    fill: Floats  # color outside of the frame, BGR
    similarity: RunningBaseline
    distractors: DistractorTracker


class _Outputs(NamedTuple):
    """What `NanoTrack.accept` needs of a search."""

    zoom: float  # px of the search crop per px of the view
    features: Tensor  # of the search crop
    logits: Tensor  # (n,)


class NanoTrack(CandidateTracker[_Target]):
    """NanoTrack's loop.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Unlike in the authors' loop, a box may be smaller than 10 pixels if the first box is smaller
    than 20: the minimum is then half of the first box.

    Parameters
    ----------
    networks : NanoTrackNetworks
    parameters : SearchParameters
    confidence : Confidence
        Its evidence is the logit of the chosen candidate, and the drop below the baseline of the
        similarity between the candidate's features and the template's.
    distractors : bool
        Whether objects like the target are recognized by their positions.
    prefers_prediction : bool
        Whether candidates near the predicted position are ranked higher.
    """

    def __init__(
        self,
        networks: NanoTrackNetworks,
        parameters: SearchParameters,
        confidence: Confidence,
        *,
        distractors: bool = False,
        prefers_prediction: bool = True,
    ) -> None:
        side = networks.head.output_shapes[0][-1]
        super().__init__(parameters, cosine_window(side), distractors)
        self._networks = networks
        self._confidence = confidence
        self.prefers_prediction = prefers_prediction
        self._points = grid_points((np.arange(side) - side // 2) * float(_STRIDE))

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; crops are padded with the frame's mean color."""
        state = TargetState.from_xywh(xywh)
        fill = view.mean_color
        crop = view.crop_square(state.center_xy, round(state.context_side), TEMPLATE_SIDE, fill)
        (kernel,) = self._networks.template(crop_tensor(crop))
        size = np.array(state.size_wh) * TEMPLATE_SIDE / state.context_side
        feature = box_feature(kernel, _STRIDE, np.array([0, 0, *size]))
        min_wh = min_size(state.size_wh)
        baseline, distractors = RunningBaseline(), DistractorTracker(self._has_distractors)
        self._start(_Target(state, min_wh, kernel, feature, fill, baseline, distractors))

    def respond(self, view: FrameView) -> Response:
        """The candidates in the next view."""
        target, last = self._target, self._target.state
        zoom = TEMPLATE_SIDE / last.context_side
        crop = view.crop_square(last.center_xy, round(SEARCH_SIDE / zoom), SEARCH_SIDE, target.fill)
        (features,) = self._networks.search(crop_tensor(crop))
        score_maps, distances = self._networks.head(target.kernel, features)
        boxes = boxes_from_distances(distances, self._points)
        background, foreground = score_maps[0].reshape(2, -1)
        return self._response(
            target.distractors,
            last,
            foreground_probability(score_maps),
            (boxes_in_view(boxes, zoom, last), boxes),
            np.array(last.size_wh) * zoom,
            _Outputs(zoom, features, foreground - background),
        )

    def accept(self, view: FrameView, response: Response, index: int) -> Track:
        """Take a candidate as the target."""
        target = self._target
        details: Details = response.details
        outputs: _Outputs = details.outputs
        box, zoom = details.boxes[:, index], outputs.zoom
        target.distractors.update(details.candidates, index)
        rate = self._learning_rate(response, index)
        target.state = next_state(target.state, box, zoom, rate, view, target.min_wh)
        similarity = float(target.feature @ box_feature(outputs.features, _STRIDE, box))
        logit = float(np.clip(outputs.logits[index], *_LOGIT_RANGE))
        weight = float(np.clip((_CERTAIN_LOGIT - logit) / _LOGIT_SPAN, 0, 1))
        drop = target.similarity.update(similarity, confident=logit > _BASELINE_LOGIT)
        evidence = logit, weight * drop
        probability = self._confidence.probability(evidence)
        probability *= min_size_iou(target.state, box[2:] / zoom, target.min_wh)
        return Track(target.state.xywh, score=probability, evidence=evidence)

    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64."""
        return flattened([self._target.kernel])

    def move_to(self, xywh: XYWH) -> None:
        """Search around `xywh`, the view's pixels, from now on."""
        self._target.state = TargetState.from_reported_xywh(xywh)
        self._target.distractors = DistractorTracker(self._has_distractors)


def onnx_pair(weights: Path) -> tuple[Path, Path]:
    """The files of backbone and head; `weights` is their folder or one of them."""
    folder = weights if weights.is_dir() else weights.parent
    if not weights.exists():
        raise WeightsError(
            f"weights {weights} do not exist: give the folder of NanoTrack's two .onnx files"
        )
    if weights.is_file() and weights.suffix != ".onnx":
        raise WeightsError(f"weights {weights} are not an .onnx file: NanoTrack runs from ONNX")
    pair = []
    for part in ("backbone", "head"):
        files = sorted(folder.glob(f"*{part}*.onnx"))
        if len(files) != 1:
            raise WeightsError(
                f"weights folder {folder} holds {len(files)} files named *{part}*.onnx, "
                "NanoTrack needs exactly one"
            )
        pair.append(files[0])
    return pair[0], pair[1]
