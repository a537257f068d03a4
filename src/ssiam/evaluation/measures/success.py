"""Measures of one-pass runs: success and precision (OTB, LaSOT), AO and SR (GOT-10k)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.eao import mean_or_nan
from ssiam.evaluation.measures.overlap import center_distance
from ssiam.evaluation.measures.regions import Floats, is_region
from ssiam.geometry import iou

# Overlap thresholds 0, .05, ... 1 of the success curve (OTB).
THRESHOLDS: Floats = np.linspace(0, 1, 21)
# Center distances that count as precise: pixels (OTB), and share of the target's size (LaSOT).
_NEAR_PIXELS, _NEAR_SHARE = 20, 0.2
# Overlap thresholds of GOT-10k's success rates.
_SR_HALF, _SR_THREE_QUARTERS = 0.5, 0.75


@dataclass(frozen=True, eq=False)
class Success:
    """Success and precision of a run, or their means over several sequences.

    Attributes
    ----------
    curve : (21,) float64
        Share of the frames whose overlap is above each of `THRESHOLDS`, 0 to 1.
    precision : float
        Share of the frames whose center is at most 20 pixels away.
    normalized_precision : float
        Share of the frames whose center distance, divided by the target's width and height, is at
        most .2.
    """

    curve: Floats
    precision: float
    normalized_precision: float

    @property
    def auc(self) -> float:
        """Area under the success curve: its mean over the thresholds."""
        return float(self.curve.mean())


@dataclass(frozen=True)
class AverageOverlap:
    """GOT-10k's measures: mean overlap, and the shares of frames above .5 and .75."""

    ao: float
    sr50: float
    sr75: float


def success(xywh: ArrayLike, truth: ArrayLike) -> Success:
    """Success and precision of boxes (N, 4) on one sequence, x, y, w, h in pixels.

    Frames whose `truth` (N, 4) is nan or has no area do not count; in all others a nan box is a
    miss. All measures are nan if no frame counts.

    Raises
    ------
    ArgumentError
        The numbers of boxes and frames differ.
    """
    boxes, true_boxes = _pair(xywh, truth)
    counted = (true_boxes[:, 2:] > 0).all(axis=1) & is_region(true_boxes)
    boxes, true_boxes = boxes[counted], true_boxes[counted]
    overlaps = np.nan_to_num(iou(boxes, true_boxes), nan=-1)
    distances = np.nan_to_num(center_distance(boxes, true_boxes), nan=np.inf)
    scaled = np.nan_to_num(center_distance(boxes, true_boxes, in_sizes=True), nan=np.inf)
    return Success(
        curve=np.array([_share(overlaps > threshold) for threshold in THRESHOLDS]),
        precision=_share(distances <= _NEAR_PIXELS),
        normalized_precision=_share(scaled <= _NEAR_SHARE),
    )


def mean_success(found: Sequence[Success]) -> Success:
    """The mean over sequences with equal weight, without those in which no frame counts."""
    known = [each for each in found if not np.isnan(each.precision)]
    if not known:
        return Success(np.full(len(THRESHOLDS), np.nan), float("nan"), float("nan"))
    return Success(
        curve=np.mean([each.curve for each in known], axis=0),
        precision=float(np.mean([each.precision for each in known])),
        normalized_precision=float(np.mean([each.normalized_precision for each in known])),
    )


def got10k_overlaps(
    xywh: ArrayLike,
    truth: ArrayLike,
    size_wh: tuple[int, int],
    covered: ArrayLike | None = None,
) -> Floats:
    """Overlaps of the frames of one run that count in GOT-10k.

    The first frame does not count, nor do frames in which the target is fully hidden. Boxes are
    clipped to the frame; a nan box is a miss.

    Parameters
    ----------
    xywh, truth : (N, 4) float
        Pixels.
    size_wh : (int, int)
        Width and height of the frames, pixels.
    covered : (N,) int, optional
        Visible part of the target, 0 (nothing) to 8 (all), from ``cover.label``.

    Raises
    ------
    ArgumentError
        The numbers of boxes and frames differ.
    """
    boxes, true_boxes = _pair(xywh, truth)
    counted = is_region(true_boxes)
    counted[:1] = False
    if covered is not None:
        counted &= np.asarray(covered) > 0
    overlaps = iou(_clipped(boxes[counted], size_wh), _clipped(true_boxes[counted], size_wh))
    return np.nan_to_num(overlaps)


def average_overlap(overlaps: Sequence[Floats]) -> AverageOverlap:
    """AO and SR over all frames of all runs; `overlaps` come from `got10k_overlaps`."""
    pooled = np.concatenate([*overlaps, np.zeros(0)])
    return AverageOverlap(
        ao=mean_or_nan(pooled),
        sr50=_share(pooled > _SR_HALF),
        sr75=_share(pooled > _SR_THREE_QUARTERS),
    )


def _pair(xywh: ArrayLike, truth: ArrayLike) -> tuple[Floats, Floats]:
    boxes, true_boxes = np.asarray(xywh, np.float64), np.asarray(truth, np.float64)
    if boxes.shape != true_boxes.shape or boxes.shape[1:] != (4,):
        raise ArgumentError(
            f"boxes of shape {boxes.shape} for ground truth of shape {true_boxes.shape}: "
            "both must be (frames, 4)"
        )
    return boxes, true_boxes


def _clipped(xywh: Floats, size_wh: tuple[int, int]) -> Floats:
    """Boxes clipped to the frame as GOT-10k's toolkit does it: the corner first, then the size."""
    corner = np.clip(xywh[:, :2], 0, size_wh)
    return np.concatenate([corner, np.clip(xywh[:, 2:], 0, size_wh - corner)], axis=1)


def _share(hits: NDArray[np.bool_]) -> float:
    return float(hits.mean()) if len(hits) else float("nan")
