"""`FearXs`: FEAR-XS, in its authors' loop.

FEAR: Fast, Efficient, Accurate and Robust Visual Tracker (Borsuk et al., ECCV 2022). The weights
are its authors' (github.com/PinataFarms/FEARTracker, MIT), converted to ONNX.

Unlike in the other Siamese trackers the crops are rectangles that are stretched to squares, and box
and crops are in whole pixels. The loop is sensitive to single pixels: with crops between pixels the
mean success on the ten test sequences is .66, with whole pixels .71.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, NamedTuple, TypeAlias

import cv2
import numpy as np

from ssiam.errors import WeightsError
from ssiam.geometry import XYWH, Image
from ssiam.runtime import Network, RuntimeOptions, Tensor
from ssiam.stabilize import FrameView
from ssiam.stabilize.view import Crop
from ssiam.track import Track
from ssiam.trackers.candidates import CandidateTracker, Details
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.distractors import DistractorTracker
from ssiam.trackers.responses import Response
from ssiam.trackers.siamese import (
    Floats,
    SearchParameters,
    TargetState,
    boxes_from_distances,
    cosine_window,
    flattened,
    grid_points,
    sigmoid,
)

FearName: TypeAlias = Literal["fear_xs"]

_TEMPLATE_SIDE: Final = 128  # px, side of the template crop
_SEARCH_SIDE: Final = 256  # px, side of the search crop
_STRIDE: Final = 16  # px between cells
_SIDE: Final = 16  # cells
_TEMPLATE_MARGIN: Final = 0.2  # on each side, share of the box's side
_SEARCH_MARGIN: Final = 2.0  # the same
_MEAN_RGB: Final = (123.675, 116.28, 103.53)  # the deviation is in the network
_MIN_SIDE: Final = 3  # px, of a box
_MIN_CANDIDATE: Final = 1e-6  # px, so that ratios are finite
_LOGIT_RANGE: Final = (-8.0, 8.0)  # to which the evidence is clipped
_MAX_WINDOW: Final = 8192  # px, side of a search region that is cut out in whole pixels

# The authors' values, except the window influence: with theirs, .38, the mean success is .712, with
# .2 it is .720 (python benchmarks/accuracy/fear_xs.py; chosen on the same ten sequences).
PARAMETERS: Final = SearchParameters(penalty_k=0.062, window_influence=0.2, lr=0.765)
# Weight and bias of the logit, from
# `python benchmarks/calibration/confidence.py --trackers fear_xs --every 12`.
CONFIDENCE: Final = Confidence((0.90,), -2.49)


@dataclass(frozen=True)
class FearNetworks:
    """The two networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` maps (1, 3, 128, 128) float32 RGB without its mean to features (1, 256, 8, 8);
    `search` maps (1, 3, 256, 256) and these to distances (1, 4, 16, 16) in px, and logits
    (1, 1, 16, 16).
    """

    template: Network
    search: Network

    @classmethod
    def load(cls, weights: Path, options: RuntimeOptions) -> FearNetworks:
        """Load the networks from the folder of the two .onnx files, or from one of them.

        Raises
        ------
        WeightsError
            The files are missing, damaged or of another network.
        """
        from ssiam.runtime.loading import load_network

        template, search = (
            load_network(
                path,
                runtime=options.runtime,
                threads=options.threads,
                precision=options.precision,
                device=options.device,
            )
            for path in fear_pair(weights)
        )
        networks = cls(template, search)
        networks._check(weights)
        return networks

    def _check(self, weights: Path) -> None:
        found = self.template.input_shapes, self.search.input_shapes, self.search.output_shapes
        features = self.template.output_shapes[:1]
        expected = (
            [(1, 3, _TEMPLATE_SIDE, _TEMPLATE_SIDE)],
            [(1, 3, _SEARCH_SIDE, _SEARCH_SIDE), *features],
            [(1, 4, _SIDE, _SIDE), (1, 1, _SIDE, _SIDE)],
        )
        if found != expected:
            raise WeightsError(
                f"{weights} holds weights of another network than fear_xs: inputs {found[0]} and "
                f"{found[1]}, outputs {found[2]}"
            )


@dataclass
class _Target:
    """State of the target."""

    xywh: XYWH  # stabilized pixels; whole ones after the first
    features: Tensor  # of the template
    distractors: DistractorTracker


class _Outputs(NamedTuple):
    """What `FearXs.accept` needs of a search."""

    scale: Floats  # (2,) px of the view per px of the search crop, in x and y
    last_wh: Floats  # (2,) size of the target, px of the search crop
    logits: Tensor  # (n,)


class FearXs(CandidateTracker[_Target]):
    """FEAR's loop.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    networks : FearNetworks
    parameters : SearchParameters
    confidence : Confidence
        Its evidence is the logit of the chosen cell.
    distractors : bool
        Whether objects like the target are recognized by their positions.
    """

    def __init__(
        self,
        networks: FearNetworks,
        parameters: SearchParameters = PARAMETERS,
        confidence: Confidence = CONFIDENCE,
        *,
        distractors: bool = False,
    ) -> None:
        super().__init__(parameters, cosine_window(_SIDE), distractors)
        self._networks = networks
        self._confidence = confidence
        offsets = (np.arange(_SIDE) - _SIDE // 2) * float(_STRIDE)
        self._points = grid_points(offsets + _SEARCH_SIDE / 2)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; crops are padded with each frame's mean color."""
        crop = _resampled(view, _expanded(xywh, _TEMPLATE_MARGIN), _TEMPLATE_SIDE)
        (features,) = self._networks.template(crop.tensor(rgb=True, mean=_MEAN_RGB))
        self._start(_Target(xywh, features, DistractorTracker(self._has_distractors)))

    def respond(self, view: FrameView) -> Response:
        """The candidates in the next view."""
        target = self._target
        crop = _resampled(view, _expanded(target.xywh, _SEARCH_MARGIN), _SEARCH_SIDE)
        distances, logits = self._networks.search(
            crop.tensor(rgb=True, mean=_MEAN_RGB), target.features
        )
        scale, corner = crop.view_from_crop.diagonal()[:2], crop.view_from_crop[:2, 2]
        last_wh = np.array(target.xywh[2:]) / scale
        boxes = boxes_from_distances(distances, self._points)
        boxes[2:] = np.maximum(boxes[2:], _MIN_CANDIDATE)
        view_boxes = (boxes.reshape(2, 2, -1) * scale[:, None]).reshape(4, -1)
        view_boxes[:2] += corner[:, None]
        return self._response(
            target.distractors,
            TargetState.from_reported_xywh(target.xywh),
            sigmoid(logits),
            (view_boxes, boxes),
            last_wh,
            _Outputs(scale, last_wh, logits.ravel()),
        )

    def accept(self, view: FrameView, response: Response, index: int) -> Track:
        """Take a candidate as the target."""
        target = self._target
        details: Details = response.details
        outputs: _Outputs = details.outputs
        target.distractors.update(details.candidates, index)
        rate = self._learning_rate(response, index)
        size_wh = outputs.last_wh + rate * (details.boxes[2:, index] - outputs.last_wh)
        size_wh = size_wh * outputs.scale
        corner_xy = response.boxes[:2, index] - size_wh / 2
        (x, y), (w, h) = corner_xy.tolist(), size_wh.tolist()
        target.xywh = _whole_pixels((x, y, w, h), view.size_wh)
        evidence = (float(np.clip(outputs.logits[index], *_LOGIT_RANGE)),)
        return Track(target.xywh, self._confidence.probability(evidence), evidence=evidence)

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, searched around `xywh`, rounded to whole pixels."""
        self.move_to(_whole_pixels(xywh, view.size_wh))
        return self.update(view)

    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64."""
        return flattened([self._target.features])

    def move_to(self, xywh: XYWH) -> None:
        """Search around `xywh`, the view's pixels, from now on."""
        self._target.xywh = xywh
        self._target.distractors = DistractorTracker(self._has_distractors)


def fear_pair(weights: Path) -> tuple[Path, Path]:
    """The files of template and search; `weights` is their folder or one of them."""
    if not weights.exists():
        raise WeightsError(
            f"weights {weights} do not exist: give the folder of fear_template.onnx and "
            "fear_search.onnx"
        )
    folder = weights if weights.is_dir() else weights.parent
    template, search = (folder / f"fear_{piece}.onnx" for piece in ("template", "search"))
    for path in (template, search):
        if not path.is_file():
            raise WeightsError(f"weights folder {folder} has no {path.name}, which fear_xs needs")
    return template, search


def _expanded(xywh: XYWH, share: float) -> tuple[int, int, int, int]:
    """The box with a margin on each side, a share of its sides, truncated to whole pixels."""
    x, y, w, h = xywh
    return (
        int(x - share * w),
        int(y - share * h),
        max(int((1 + 2 * share) * w), 1),
        max(int((1 + 2 * share) * h), 1),
    )


def _resampled(view: FrameView, window_xywh: tuple[int, int, int, int], side: int) -> Crop:
    """A window of the view, cut out in whole pixels and then stretched to (side, side)."""
    x, y, w, h = window_xywh
    fill = view.mean_color
    if max(w, h) > _MAX_WINDOW:
        return view.crop(window_xywh, (side, side), fill.tolist())
    if view.is_raw:
        patch = _padded_window(view.raw, window_xywh, fill)
    else:
        stab_from_patch = np.array([[1.0, 0, x], [0, 1, y], [0, 0, 1]])
        warped = cv2.warpAffine(
            view.raw,
            (view.raw_from_stab @ stab_from_patch)[:2],
            (w, h),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=fill.tolist(),
        )
        patch = np.asarray(warped, dtype=np.uint8)
    image = np.asarray(cv2.resize(patch, (side, side)), dtype=np.uint8)
    return Crop(image, np.array([[w / side, 0, x], [0, h / side, y], [0, 0, 1]]))


def _padded_window(image: Image, window_xywh: tuple[int, int, int, int], fill: Floats) -> Image:
    """A window (h, w, 3) of the image, with `fill` outside of the image."""
    x, y, w, h = window_xywh
    height, width = image.shape[:2]
    patch = np.empty((h, w, 3), np.uint8)
    patch[:] = fill.astype(np.uint8)
    left, top, right, bottom = max(x, 0), max(y, 0), min(x + w, width), min(y + h, height)
    if left < right and top < bottom:
        patch[top - y : bottom - y, left - x : right - x] = image[top:bottom, left:right]
    return patch


def _whole_pixels(xywh: XYWH, size_wh: tuple[int, int]) -> XYWH:
    """The box with its edges at whole pixels, inside of a frame of (width, height)."""
    width, height = size_wh
    least_w, least_h = min(_MIN_SIDE, width), min(_MIN_SIDE, height)
    x, y, w, h = xywh
    left, top, right, bottom = (
        round(value) if math.isfinite(value) else 0 for value in (x, y, x + w, y + h)
    )
    left, top = min(max(left, 0), width - least_w), min(max(top, 0), height - least_h)
    right = min(max(right, left + least_w), width)
    bottom = min(max(bottom, top + least_h), height)
    return float(left), float(top), float(right - left), float(bottom - top)
