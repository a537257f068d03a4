"""FEAR-XS as a peer of our trackers, on OpenVINO.

    python benchmarks/fear_xs.py [--data FOLDER] [--stabilize off,predict]

Success of one pass over the sequences of a folder, the shared ones unless given. Other benchmarks
load it by the name "fear_xs" (see loading.py).

FEAR: Fast, Efficient, Accurate and Robust Visual Tracker (ECCV 2022); the weights are those that
its authors publish (github.com/PinataFarms/FEARTracker, MIT), as ONNX in the folder of test data.
It is neither shipped nor a dependency. Its loop is chaotic in single pixels: whether the skier is
held hangs on how a box is rounded.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from shared_data import SEQUENCES, WEIGHTS, sequences
from ssiam.evaluation.regions import upright
from ssiam.evaluation.success import success
from ssiam.geometry import XYWH, Image
from ssiam.runtime import Network, Tensor, load_network
from ssiam.stabilize import FrameView, Method, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers.confidence import Confidence
from ssiam.trackers.stabilized import StabilizedTracker

NAME = "fear_xs"
TEMPLATE, SEARCH = 128, 256  # px, sides of the crops
STRIDE, SIDE = 16, 16  # px between cells, and cells along a side
AROUND_TEMPLATE, AROUND_SEARCH = 0.2, 2.0  # of the box's sides, added on each side
MEAN_RGB = (123.675, 116.28, 103.53)
SMALLEST = 3  # px, the least side of a box
LOGITS = (-8.0, 8.0)  # beyond these a score says no more
# Of the logit; from `python benchmarks/confidence.py --trackers fear_xs --every 12`.
CONFIDENCE = Confidence((0.90,), -2.49)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Parameters:
    """The authors' numbers, but for the window's weight (theirs is .38).

    Attributes
    ----------
    penalty : float
        How strongly a change of size or shape counts against a candidate.
    window : float
        Weight 0..1 of the cosine window.
    rate : float
        How fast the size follows, 0..1.
    """

    penalty: float = 0.062
    window: float = 0.2
    rate: float = 0.765


class FearXs:
    """The authors' loop, in whole pixels, on any frame view.

    The box, both crops and the search are in whole pixels of the view. On the raw frame this is
    their loop; on a stabilized view the same rectangle is drawn at the view's own resolution.

    Parameters
    ----------
    template, search : Network
    parameters : Parameters
    confidence : Confidence
        Of the chosen cell's logit.
    """

    can_seek, reseek_below = True, 0.0

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
        middles = (np.arange(SIDE) - SIDE // 2) * STRIDE + SEARCH / 2
        self._middles = np.stack(np.meshgrid(middles, middles)).reshape(2, -1)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`."""
        self._box = xywh
        crop = stretched(view, grown(xywh, AROUND_TEMPLATE), TEMPLATE)
        (self._features,) = self._template(tensor(crop))

    def track(self, view: FrameView) -> Track:
        """The target in the next view."""
        x, y, w, h = window = grown(self._box, AROUND_SEARCH)
        crop = stretched(view, window, SEARCH)
        distances, logits = self._search(tensor(crop), self._features)
        scale = np.array([w, h]) / SEARCH
        last = np.array(self._box[2:]) / scale
        boxes = self._boxes(distances)
        score = 1 / (1 + np.exp(-logits.ravel().astype(np.float64)))
        best, rate = self._chosen(boxes, score, last)
        centre = boxes[:2, best] * scale + (x, y)
        size = (last + rate * (boxes[2:, best] - last)) * scale
        self._box = whole((*(centre - size / 2), *size), view.size_wh)
        evidence = (float(np.clip(logits.ravel()[best], *LOGITS)),)
        return Track(self._box, self._confidence.probability(evidence), evidence=evidence)

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, looked for around `xywh`."""
        self._box = whole(xywh, view.size_wh)
        return self.track(view)

    def clone(self) -> FearXs:
        """A second tracker on the same networks."""
        return FearXs(self._template, self._search, self._parameters, self._confidence)

    def _boxes(self, distances: Tensor) -> Floats:
        """Candidates (4, n): center and size in pixels of the search crop."""
        left, top, right, bottom = distances[0].reshape(4, -1).astype(np.float64)
        x, y = self._middles
        return np.stack(
            [x + (right - left) / 2, y + (bottom - top) / 2, left + right, top + bottom]
        )

    def _chosen(self, boxes: Floats, score: Floats, last_wh: Floats) -> tuple[int, float]:
        """Index of the best candidate, and the share 0..1 by which the size goes over to its."""
        sizes = np.maximum(boxes[2:], 1e-6)
        change = ratio(padded(sizes) / padded(last_wh))
        shape = ratio((last_wh[0] / last_wh[1]) / (sizes[0] / sizes[1]))
        penalty = np.exp(-(change * shape - 1) * self._parameters.penalty)
        share = self._parameters.window
        best = int(np.argmax(penalty * score * (1 - share) + self._window * share))
        return best, float(penalty[best] * score[best] * self._parameters.rate)


def load(
    stabilize: Method | StabilizerConfig = "off",
    threads: int = 1,
    parameters: Parameters | None = None,
) -> StabilizedTracker:
    """FEAR-XS, stabilized, as `ssiam.load_tracker` gives others."""
    template, search = (
        load_network(WEIGHTS / NAME / f"fear_{piece}.onnx", threads=threads)
        for piece in ("template", "search")
    )
    config = StabilizerConfig(stabilize) if isinstance(stabilize, str) else stabilize
    return StabilizedTracker(FearXs(template, search, parameters), config)


def grown(xywh: XYWH, share: float) -> tuple[int, int, int, int]:
    """The box with a share of its sides added on each side, its numbers cut to whole pixels."""
    x, y, w, h = xywh
    return (
        int(x - share * w),
        int(y - share * h),
        max(int((1 + 2 * share) * w), 1),
        max(int((1 + 2 * share) * h), 1),
    )


def stretched(view: FrameView, window: tuple[int, int, int, int], side: int) -> Image:
    """A window of whole pixels of the view, stretched to (side, side, 3) uint8 BGR."""
    x, y, w, h = window
    fill = view.raw.mean(axis=(0, 1))
    if view.is_raw:
        patch = bordered(view.raw, window, fill)
    else:
        stab_from_patch = np.array([[1.0, 0, x], [0, 1, y], [0, 0, 1]])
        patch = cv2.warpAffine(
            view.raw,
            (view.raw_from_stab @ stab_from_patch)[:2],
            (w, h),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=fill.tolist(),
        )
    return np.asarray(cv2.resize(patch, (side, side)), dtype=np.uint8)


def bordered(image: Image, window: tuple[int, int, int, int], fill: Floats) -> Image:
    """A window (h, w, 3) of the image, `fill` outside of it."""
    x, y, w, h = window
    height, width = image.shape[:2]
    patch = np.empty((h, w, 3), np.uint8)
    patch[:] = fill.astype(np.uint8)
    left, top, right, bottom = max(x, 0), max(y, 0), min(x + w, width), min(y + h, height)
    if left < right and top < bottom:
        patch[top - y : bottom - y, left - x : right - x] = image[top:bottom, left:right]
    return patch


def tensor(crop: Image) -> Tensor:
    """A crop as the networks take it: (1, 3, side, side) float32 RGB without its mean."""
    rgb = crop[..., ::-1].astype(np.float32) - np.float32(MEAN_RGB)
    return np.ascontiguousarray(rgb.transpose(2, 0, 1)[None])


def whole(xywh: XYWH, size_wh: tuple[int, int]) -> XYWH:
    """The box with its edges at whole pixels, inside of a frame of (width, height)."""
    width, height = size_wh
    x, y, w, h = xywh
    left, top, right, bottom = (
        round(value) if math.isfinite(value) else 0 for value in (x, y, x + w, y + h)
    )
    left, top = min(max(left, 0), width - SMALLEST), min(max(top, 0), height - SMALLEST)
    right = min(max(right, left + SMALLEST), width)
    bottom = min(max(bottom, top + SMALLEST), height)
    return float(left), float(top), float(right - left), float(bottom - top)


def padded(size_wh: Floats) -> Floats:
    """Size (n,) of sides (2, n) with half of their sum around."""
    padding = size_wh.sum(axis=0) / 2
    return np.sqrt((size_wh[0] + padding) * (size_wh[1] + padding))


def ratio(value: Floats) -> Floats:
    """By how much a quotient differs from 1, either way."""
    return np.maximum(value, 1 / value)


def main() -> None:
    """Print the success of every sequence, and the mean."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=SEQUENCES)
    parser.add_argument("--stabilize", default="off", help="methods, with commas")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    for method in chosen.stabilize.split(","):
        found = {}
        for name, sequence in sequences(chosen.data).items():
            tracker, images = load(method), sequence.images()
            tracker.init(next(images), sequence.box(0))
            boxes = [sequence.box(0), *(tracker.update(image).box for image in images)]
            found[name] = success(boxes, upright(sequence.truth)).auc
        cells = ", ".join(f"{name} {auc:.2f}" for name, auc in found.items())
        print(f"{method}: {np.mean(list(found.values())):.3f} ({cells})", flush=True)


if __name__ == "__main__":
    main()
