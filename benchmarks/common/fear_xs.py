"""FEAR-XS, a tracker of other authors, as a peer in the benchmarks, on OpenVINO.

FEAR: Fast, Efficient, Accurate and Robust Visual Tracker (ECCV 2022). The weights are those that
its authors publish (github.com/PinataFarms/FEARTracker, MIT), as ONNX in the folder of test data.
The tracker is neither part of the package nor a dependency of it.

Its loop works in whole pixels and is sensitive to single pixels: whether it tracks the skier of the
test sequences depends on how a box is rounded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.data import WEIGHTS
from ssiam.geometry import XYWH, Image
from ssiam.runtime import Network, Tensor, load_network
from ssiam.stabilize import FrameView, Method, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.stabilized import StabilizedTracker

NAME = "fear_xs"
TEMPLATE, SEARCH = 128, 256  # px, sides of the crops
STRIDE, SIDE = 16, 16  # px between cells, and cells along a side
TEMPLATE_MARGIN, SEARCH_MARGIN = 0.2, 2.0  # on each side, share of the box's side
MEAN_RGB = (123.675, 116.28, 103.53)
MIN_SIDE = 3  # px, of a box
LOGIT_RANGE = (-8.0, 8.0)  # the score saturates beyond
# Weight and bias of the logit, from
# `python benchmarks/calibration/confidence.py --trackers fear_xs --every 12`.
CONFIDENCE = Confidence((0.90,), -2.49)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Parameters:
    """Parameters of the search: the authors' values, except the window influence (theirs is .38).

    Attributes
    ----------
    penalty : float
        Strength of the penalty on changes of size and shape.
    window : float
        Window influence, 0 to 1.
    rate : float
        Rate at which the size follows the prediction, 0 to 1.
    """

    penalty: float = 0.062
    window: float = 0.2
    rate: float = 0.765


class FearXs:
    """The authors' tracking loop on a frame view.

    The box and both crops are in whole pixels of the view. On the raw frame this is the authors'
    loop; on a stabilized view the same rectangle is sampled at the resolution of the view.

    Parameters
    ----------
    template, search : Network
    parameters : Parameters
    confidence : Confidence
        From the logit of the best cell.
    """

    can_seek, reseek_below, center_inset = True, 0.0, 1.0

    def __init__(
        self,
        template: Network,
        search: Network,
        parameters: Parameters | None = None,
        confidence: Confidence | None = None,
    ) -> None:
        self._template, self._search = template, search
        self._parameters = parameters or Parameters()
        self._confidence = confidence or CONFIDENCE
        hanning = np.hanning(SIDE)
        self._window = np.outer(hanning, hanning).ravel()
        centers = (np.arange(SIDE) - SIDE // 2) * STRIDE + SEARCH / 2
        self._centers = np.stack(np.meshgrid(centers, centers)).reshape(2, -1)
        self._box: XYWH = (0.0, 0.0, 0.0, 0.0)
        self._features: Tensor = np.empty(0, np.float32)  # of the template

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from the box `xywh` of the view, pixels."""
        self._box = xywh
        crop = _resampled(view, _expanded(xywh, TEMPLATE_MARGIN), TEMPLATE)
        (self._features,) = self._template(_tensor(crop))

    def update(self, view: FrameView) -> Track:
        """Track the target into the next view."""
        x, y, w, h = window = _expanded(self._box, SEARCH_MARGIN)
        crop = _resampled(view, window, SEARCH)
        distances, logits = self._search(_tensor(crop), self._features)
        scale = np.array([w, h]) / SEARCH
        last = np.array(self._box[2:]) / scale
        boxes = self._boxes(distances)
        score = 1 / (1 + np.exp(-logits.ravel().astype(np.float64)))
        best, rate = self._best(boxes, score, last)
        center = boxes[:2, best] * scale + (x, y)
        size = (last + rate * (boxes[2:, best] - last)) * scale
        self._box = _whole_pixels((*(center - size / 2), *size), view.size_wh)
        evidence = (float(np.clip(logits.ravel()[best], *LOGIT_RANGE)),)
        return Track(self._box, self._confidence.probability(evidence), evidence=evidence)

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """Search the target in this view around `xywh`."""
        self._box = _whole_pixels(xywh, view.size_wh)
        return self.update(view)

    def clone(self) -> FearXs:
        """A new tracker with the same networks, without a target."""
        return FearXs(self._template, self._search, self._parameters, self._confidence)

    def _boxes(self, distances: Tensor) -> Floats:
        """Candidate boxes (4, n): center x, y and w, h in pixels of the search crop."""
        left, top, right, bottom = distances[0].reshape(4, -1).astype(np.float64)
        x, y = self._centers
        return np.stack(
            [x + (right - left) / 2, y + (bottom - top) / 2, left + right, top + bottom]
        )

    def _best(self, boxes: Floats, score: Floats, last_wh: Floats) -> tuple[int, float]:
        """Index of the best candidate, and the update rate 0..1 of the size."""
        sizes = np.maximum(boxes[2:], 1e-6)
        change = _ratio(_padded_size(sizes) / _padded_size(last_wh))
        shape = _ratio((last_wh[0] / last_wh[1]) / (sizes[0] / sizes[1]))
        penalty = np.exp(-(change * shape - 1) * self._parameters.penalty)
        influence = self._parameters.window
        best = int(np.argmax(penalty * score * (1 - influence) + self._window * influence))
        return best, float(penalty[best] * score[best] * self._parameters.rate)


def load(
    stabilize: Method | StabilizerConfig = "off",
    threads: int = 1,
    parameters: Parameters | None = None,
) -> StabilizedTracker:
    """Load FEAR-XS as `ssiam.load_tracker` loads the trackers of the package."""
    template, search = (
        load_network(WEIGHTS / NAME / f"fear_{piece}.onnx", threads=threads)
        for piece in ("template", "search")
    )
    config = StabilizerConfig(stabilize) if isinstance(stabilize, str) else stabilize
    return StabilizedTracker(FearXs(template, search, parameters), config)


def _expanded(xywh: XYWH, share: float) -> tuple[int, int, int, int]:
    """The box with a margin on each side, a share of its sides, truncated to whole pixels."""
    x, y, w, h = xywh
    return (
        int(x - share * w),
        int(y - share * h),
        max(int((1 + 2 * share) * w), 1),
        max(int((1 + 2 * share) * h), 1),
    )


def _resampled(view: FrameView, window: tuple[int, int, int, int], side: int) -> Image:
    """A window of the view in whole pixels, resized to (side, side, 3) uint8 BGR."""
    x, y, w, h = window
    fill = view.raw.mean(axis=(0, 1))
    if view.is_raw:
        patch = _padded_window(view.raw, window, fill)
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
    return np.asarray(cv2.resize(patch, (side, side)), dtype=np.uint8)


def _padded_window(image: Image, window: tuple[int, int, int, int], fill: Floats) -> Image:
    """A window (h, w, 3) of the image, with `fill` outside of the image."""
    x, y, w, h = window
    height, width = image.shape[:2]
    patch = np.empty((h, w, 3), np.uint8)
    patch[:] = fill.astype(np.uint8)
    left, top, right, bottom = max(x, 0), max(y, 0), min(x + w, width), min(y + h, height)
    if left < right and top < bottom:
        patch[top - y : bottom - y, left - x : right - x] = image[top:bottom, left:right]
    return patch


def _tensor(crop: Image) -> Tensor:
    """A crop as network input: (1, 3, side, side) float32 RGB minus the mean."""
    rgb = crop[..., ::-1].astype(np.float32) - np.array(MEAN_RGB, np.float32)
    return np.ascontiguousarray(rgb.transpose(2, 0, 1)[None])


def _whole_pixels(xywh: XYWH, size_wh: tuple[int, int]) -> XYWH:
    """The box with its edges at whole pixels, inside of the frame."""
    width, height = size_wh
    x, y, w, h = xywh
    left, top, right, bottom = (
        round(value) if math.isfinite(value) else 0 for value in (x, y, x + w, y + h)
    )
    left, top = min(max(left, 0), width - MIN_SIDE), min(max(top, 0), height - MIN_SIDE)
    right = min(max(right, left + MIN_SIDE), width)
    bottom = min(max(bottom, top + MIN_SIDE), height)
    return float(left), float(top), float(right - left), float(bottom - top)


def _padded_size(size_wh: Floats) -> Floats:
    """Side (n,) of the square with the area of boxes (2, n) padded by half of w + h."""
    padding = size_wh.sum(axis=0) / 2
    return np.asarray(np.sqrt((size_wh[0] + padding) * (size_wh[1] + padding)))


def _ratio(value: Floats) -> Floats:
    """The ratio or its inverse, whichever is at least 1."""
    return np.maximum(value, 1 / value)
