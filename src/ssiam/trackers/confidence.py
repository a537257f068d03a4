"""Confidence scores: a tracker's evidence, and the probability that its box is right.

The scores of different trackers are not comparable, and most of them stay high after the tracker
has switched to a distractor. A logistic model (`Confidence`) maps each tracker's evidence to one
quantity: the probability that the box overlaps the target by more than half (IoU > 0.5). The
evidence of the Siamese trackers is their logit and the similarity between the features in the box
and the template's (`box_feature`), relative to its `RunningBaseline`. OpenCV's trackers have no
score; their evidence is an `AppearanceModel`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image
from ssiam.runtime import Tensor
from ssiam.stabilize import FrameView

Floats = NDArray[np.float64]

# For `box_feature`.
_CORE: Final = 0.8  # central share of the box's sides that is averaged; the rest has background

# For `RunningBaseline`.
_RATE: Final = 0.05  # weight of a new value in the running mean
_RATE_CONFIDENT: Final = 0.2  # the same if the tracker is confident
_OUTLIER: Final = 0.1  # drop from which a value is added to the mean only if confident
_TOLERANCE: Final = 0.05  # smaller drops are ignored
_MAX_DROP: Final = 0.2  # larger drops saturate

# For `AppearanceModel`.
_SAMPLES: Final = 16  # number along the geometric mean of the target's sides
_MIN_SAMPLES, _MAX_SAMPLES = 6, 48  # number along one side
_OVERSAMPLING: Final = 2  # interpolated pixels along each side that are averaged into a sample
_MAX_OFFSET: Final = 2  # samples by which a box may be displaced
_MIN_DEVIATION: Final = 1.0  # gray levels, standard deviation of a usable template


@dataclass(frozen=True)
class Confidence:
    """A logistic model of the confidence score, fitted by benchmarks/calibration/confidence.py.

    Attributes
    ----------
    weights : tuple of float
        One for each number of the evidence.
    bias : float
    """

    weights: tuple[float, ...]
    bias: float

    def probability(self, evidence: tuple[float, ...]) -> float:
        """Probability that the box overlaps the target by more than half, 0..1."""
        pairs = zip(self.weights, evidence, strict=True)
        return 0.5 + 0.5 * math.tanh((self.bias + sum(w * e for w, e in pairs)) / 2)


class RunningBaseline:
    """Running mean of a value of the tracked target, and the drop of new values below it."""

    def __init__(self) -> None:
        self._mean: float | None = None

    def update(self, value: float, confident: bool) -> float:
        """The drop of a new value below the running mean, which is then updated.

        Parameters
        ----------
        value : float
        confident : bool
            Whether other evidence shows that the target is in the box. If not, a value far below
            the mean does not change the mean.

        Returns
        -------
        float
            0 or negative. Small drops are ignored, large drops saturate.
        """
        if self._mean is None:
            self._mean = value
        difference = value - self._mean
        if confident or difference > -_OUTLIER:
            self._mean += (_RATE_CONFIDENT if confident else _RATE) * difference
        return max(min(difference + _TOLERANCE, 0.0), -_MAX_DROP)


def box_feature(features: Tensor, stride: float, box: Floats) -> Floats:
    """Mean of a network's features in a box, scaled to a unit vector.

    Parameters
    ----------
    features : (1, C, n, n) float32
    stride : float
        Crop pixels between features.
    box : (4,) float64
        cx, cy, w, h in crop pixels from the crop's center.

    Returns
    -------
    (C,) float64
        Of length 1; zeros if all features are zero.
    """
    side = features.shape[-1]
    positions = (np.arange(side) - (side - 1) / 2) * stride
    cx, cy, w, h = box
    rows, columns = _cells(positions, cy, h, stride), _cells(positions, cx, w, stride)
    mean = features[0][:, rows, columns].mean(axis=(1, 2), dtype=np.float64)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12))


def _cells(positions: Floats, center: float, extent: float, stride: float) -> slice:
    """The slice of the features inside a box along one axis, at least the nearest feature."""
    reach = max(_CORE * extent / 2, stride / 2)
    first = int(np.searchsorted(positions, center - reach))
    last = int(np.searchsorted(positions, center + reach))
    first = min(first, len(positions) - 1)
    return slice(first, max(last, first + 1))


class AppearanceModel:
    """The target's first and recent appearance: templates of a few hundred averaged pixels.

    They are compared with a box by normalized cross-correlation.

    Parameters
    ----------
    view : FrameView
    xywh : (x, y, w, h)
        The target's box, stabilized pixels.
    """

    def __init__(self, view: FrameView, xywh: XYWH) -> None:
        _, _, w, h = xywh
        per_pixel = _SAMPLES / np.sqrt(w * h)
        self._grid_wh = tuple(
            int(np.clip(round(side * per_pixel), _MIN_SAMPLES, _MAX_SAMPLES)) for side in (w, h)
        )
        self._first = self._recent = self._sampled(view, xywh, 0)

    def update(self, view: FrameView, xywh: XYWH) -> None:
        """Take the pixels in `xywh` as the recent appearance."""
        self._recent = self._sampled(view, xywh, 0)

    def similarity(self, view: FrameView, xywh: XYWH) -> tuple[float, float]:
        """Correlation (-1..1) of the pixels in `xywh` with the first and the recent appearance.

        It is the maximum over displacements of up to two samples.
        """
        first, recent = self._correlation_maps(self._sampled(view, xywh, _MAX_OFFSET))
        return float(first.max()), float(recent.max())

    def find(self, view: FrameView, xywh: XYWH, reach: float) -> XYWH:
        """The box most similar to the target, at most `reach` target sizes from `xywh`."""
        margin = round(reach * _SAMPLES)
        correlation = np.maximum(*self._correlation_maps(self._sampled(view, xywh, margin)))
        row, column = np.unravel_index(int(correlation.argmax()), correlation.shape)
        x, y, w, h = xywh
        columns, rows = self._grid_wh
        return x + (int(column) - margin) * w / columns, y + (int(row) - margin) * h / rows, w, h

    def _correlation_maps(self, image: Image) -> list[NDArray[np.float32]]:
        return [_correlation(image, template) for template in (self._first, self._recent)]

    def _sampled(self, view: FrameView, xywh: XYWH, margin: int) -> Image:
        """The box and `margin` more samples on each side: (rows, columns, 3) uint8."""
        x, y, w, h = xywh
        box_columns, box_rows = self._grid_wh
        step_x, step_y = w / box_columns / _OVERSAMPLING, h / box_rows / _OVERSAMPLING
        left, top = x - margin * w / box_columns, y - margin * h / box_rows
        stab_from_samples = np.array(
            [
                [step_x, 0, left + step_x / 2 - 0.5],
                [0, step_y, top + step_y / 2 - 0.5],
                [0, 0, 1],
            ]
        )
        columns, rows = box_columns + 2 * margin, box_rows + 2 * margin
        fine = cv2.warpAffine(
            view.raw,
            (view.raw_from_stab @ stab_from_samples)[:2],
            (columns * _OVERSAMPLING, rows * _OVERSAMPLING),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
        )
        sampled = cv2.resize(fine, (columns, rows), interpolation=cv2.INTER_AREA)
        return np.asarray(sampled, dtype=np.uint8)


def _correlation(image: Image, template: Image) -> NDArray[np.float32]:
    """Correlation -1..1 at each position of a template in an image; 0 for a flat template."""
    found = cv2.matchTemplate(image, template, cv2.TM_CCOEFF_NORMED)
    usable = template.std() >= _MIN_DEVIATION
    return np.asarray(np.nan_to_num(found) if usable else 0 * found, np.float32)
