"""Measures of one-pass runs: success and precision of OTB and LaSOT, AO and SR of GOT-10k."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.errors import ArgumentError
from ssiam.evaluation.eao import mean_or_nan
from ssiam.evaluation.overlap import centre_distance
from ssiam.evaluation.raster import Floats
from ssiam.evaluation.regions import is_region
from ssiam.geometry import iou

# Overlaps 0, .05, ... 1 at which success is asked for (OTB).
THRESHOLDS: Floats = np.linspace(0, 1, 21)
# Pixels, and share of the target's size, within which a centre is precise (OTB; LaSOT).
_NEAR_PIXELS, _NEAR_SHARE = 20, 0.2
# Overlaps that GOT-10k calls a success.
_SR_HALF, _SR_THREE_QUARTERS = 0.5, 0.75


@dataclass(frozen=True, eq=False)
class Success:
    """How well a run of a sequence, or the mean of several sequences, holds its target.

    Attributes
    ----------
    curve : (21,) float64
        Share of the frames whose overlap is above each of `THRESHOLDS`.
    precision : float
        Share of the frames whose centre is at most 20 pixels off.
    normalised_precision : float
        Share of the frames whose centre is off by at most .2 of the target's width and height.
    """

    curve: Floats
    precision: float
    normalised_precision: float

    @property
    def auc(self) -> float:
        """Area under the curve: the mean over the thresholds."""
        return float(self.curve.mean())


@dataclass(frozen=True)
class AverageOverlap:
    """GOT-10k's measures: mean overlap, and the shares of frames above .5 and .75."""

    ao: float
    sr50: float
    sr75: float


def success(xywh: ArrayLike, truth: ArrayLike) -> Success:
    """Success of the boxes (N, 4) of one sequence; pixels.

    Frames whose `truth` (N, 4) is nan, or has no area, do not count; in the others a box that is
    nan is a miss. All measures are nan if no frame counts.

    Raises
    ------
    ArgumentError
        There are not as many boxes as frames.
    """
    boxes, true_boxes = _pair(xywh, truth)
    counted = (true_boxes[:, 2:] > 0).all(axis=1) & is_region(true_boxes)
    boxes, true_boxes = boxes[counted], true_boxes[counted]
    overlaps = np.nan_to_num(iou(boxes, true_boxes), nan=-1)
    distances = np.nan_to_num(centre_distance(boxes, true_boxes), nan=np.inf)
    scaled = np.nan_to_num(centre_distance(boxes, true_boxes, in_sizes=True), nan=np.inf)
    return Success(
        curve=np.array([_share(overlaps > threshold) for threshold in THRESHOLDS]),
        precision=_share(distances <= _NEAR_PIXELS),
        normalised_precision=_share(scaled <= _NEAR_SHARE),
    )


def mean_success(found: Sequence[Success]) -> Success:
    """The mean over sequences, each counting alike; those without a frame that counts do not."""
    known = [each for each in found if not np.isnan(each.precision)]
    if not known:
        return Success(np.full(len(THRESHOLDS), np.nan), float("nan"), float("nan"))
    return Success(
        curve=np.mean([each.curve for each in known], axis=0),
        precision=float(np.mean([each.precision for each in known])),
        normalised_precision=float(np.mean([each.normalised_precision for each in known])),
    )


def got10k_overlaps(
    xywh: ArrayLike,
    truth: ArrayLike,
    size_wh: tuple[int, int],
    covered: ArrayLike | None = None,
) -> Floats:
    """Overlaps of one run that count for GOT-10k.

    The first frame does not count, nor does one of which nothing is visible. Boxes are clipped to
    the frame; one that is nan is a miss.

    Parameters
    ----------
    xywh, truth : (N, 4) float
        Pixels.
    size_wh : (int, int)
        Width and height of the frames, pixels.
    covered : (N,) int, optional
        How much of the target is visible, 0 (nothing) to 8, from ``cover.label``.

    Raises
    ------
    ArgumentError
        There are not as many boxes as frames.
    """
    boxes, true_boxes = _pair(xywh, truth)
    counted = is_region(true_boxes)
    counted[:1] = False
    if covered is not None:
        counted &= np.asarray(covered) > 0
    overlaps = iou(_clipped(boxes[counted], size_wh), _clipped(true_boxes[counted], size_wh))
    return np.nan_to_num(overlaps)


def average_overlap(overlaps: Sequence[Floats]) -> AverageOverlap:
    """AO and SR over all frames of all runs; `overlaps` are those of `got10k_overlaps`."""
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
            f"boxes of the shape {boxes.shape} for a truth of {true_boxes.shape}: "
            "both must be (frames, 4)"
        )
    return boxes, true_boxes


def _clipped(xywh: Floats, size_wh: tuple[int, int]) -> Floats:
    """Boxes within the frame, as GOT-10k's toolkit cuts them: the corner first, then the size."""
    corner = np.clip(xywh[:, :2], 0, size_wh)
    return np.concatenate([corner, np.clip(xywh[:, 2:], 0, size_wh - corner)], axis=1)


def _share(hits: NDArray[np.bool_]) -> float:
    return float(hits.mean()) if len(hits) else float("nan")
