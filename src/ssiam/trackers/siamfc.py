"""SiamFC: one response map at each of three scales.

Bertinetto et al., "Fully-Convolutional Siamese Networks for Object Tracking" (2016). The loop is
that of huanglianghua/siamfc-pytorch in single precision, on which some roundings depend.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, mean_color
from ssiam.runtime import Network, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.distractors import DistractorTracker, Flags, ScoredCandidates
from ssiam.trackers.reference_crops import siamfc_crop
from ssiam.trackers.siamese import (
    CONTEXT,
    TEMPLATE_SIDE,
    Floats,
    SiameseTracker,
    TargetState,
    crop_tensor,
    flattened,
    grid_points,
    sigmoid,
)

SiamFcName: TypeAlias = Literal["siamfc"]
Singles = NDArray[np.float32]

_SEARCH_SIDE: Final = 255  # px, side of the search crop
_STRIDE: Final = 8  # px of the search crop between cells of the response map
_UPSAMPLING: Final = 16  # cells of the upsampled response map per cell, along one axis
_SIDE: Final = 17  # cells along the side of the response map
_FINE_SIDE: Final = _SIDE * _UPSAMPLING  # the same for the upsampled response map
_MIN_SIDE: Final = 2.0  # px, minimum of the target's shorter side


@dataclass(frozen=True)
class SiamFcParameters:
    """Hyperparameters of SiamFC; the defaults are the authors' for all benchmarks.

    Parameters
    ----------
    scale_step : float
        Ratio between neighboring scales.
    scale_lr : float
        Learning rate of the size, 0..1: how fast it follows the best scale.
    scale_penalty : float
        Factor on the responses at the smaller and the larger scale.
    window_influence : float
        Weight 0..1 of the cosine window, which prefers positions near the last one.
    """

    scale_step: float = 1.0375
    scale_lr: float = 0.59
    scale_penalty: float = 0.9745
    window_influence: float = 0.176


@dataclass(frozen=True)
class SiamFcNetworks:
    """The two networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` maps (1, 3, 127, 127) float32 **RGB** in 0..255 to a kernel (1, 256, 6, 6);
    `search` maps three crops (3, 3, 255, 255) and the kernel to responses (3, 1, 17, 17).
    """

    template: Network
    search: Network


@dataclass
class _Target:
    """State of the target, in the reference's single precision."""

    kernel: Tensor
    fill: Floats  # color outside of the frame, RGB
    center: Singles  # (2,) stabilized pixels
    size: Singles  # (2,) width and height
    search_side: float  # side of the search region at the middle scale, stabilized pixels
    distractors: DistractorTracker

    @property
    def xywh(self) -> XYWH:
        cx, cy, w, h = (float(value) for value in (*self.center, *self.size))
        return cx - (w - 1) / 2, cy - (h - 1) / 2, w, h


class SiamFc(SiameseTracker[_Target]):
    """SiamFC's loop.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Unlike in the reference, a target does not shrink below 2 pixels or grow beyond the frame: the
    reference fails there on an empty crop, or on one that exhausts the memory.

    Parameters
    ----------
    networks : SiamFcNetworks
    parameters : SiamFcParameters, optional
    distractors : bool
        Whether objects like the target are recognized by their positions.
    """

    score_is_calibrated = False

    def __init__(
        self,
        networks: SiamFcNetworks,
        parameters: SiamFcParameters | None = None,
        *,
        distractors: bool = False,
    ) -> None:
        super().__init__(distractors)
        self._networks = networks
        self._parameters = parameters or SiamFcParameters()
        self._factors: Floats = self._parameters.scale_step ** np.array([-1.0, 0.0, 1.0])
        penalty = self._parameters.scale_penalty
        self._penalties = np.array([penalty, 1, penalty], np.float32)[:, None, None]
        hanning = np.hanning(_FINE_SIDE)
        window = np.outer(hanning, hanning)
        self._window: Floats = window / window.sum()
        self._points = grid_points((np.arange(_SIDE) - _SIDE // 2) * float(_STRIDE))

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; crops are padded with the frame's mean color."""
        center, size, search_side = _geometry(xywh)
        fill: Floats = mean_color(view.raw)[::-1]
        crop = siamfc_crop(view, center, float(_template_side(size)), TEMPLATE_SIDE, fill)
        (kernel,) = self._networks.template(crop_tensor(crop))
        distractors = DistractorTracker(self._has_distractors)
        self._start(_Target(kernel, fill, center, size, search_side, distractors))

    def update(self, view: FrameView) -> Track:
        """The target in the next view.

        The score is the sigmoid of the response at the chosen position: the probability in the
        logistic loss of the network.
        """
        target = self._target
        responses = self._responses(view, target)
        candidates = self._candidates(responses, target)
        fine = _upsampled(responses, candidates.is_distractor)
        scale = int(np.argmax((fine * self._penalties).max(axis=(1, 2))))
        row, column = self._peak(fine[scale] * self._penalties[scale])
        cell = (row // _UPSAMPLING) * _SIDE + column // _UPSAMPLING
        target.distractors.update(candidates, cell)
        score = float((1 + np.tanh(float(fine[scale, row, column]) / 2)) / 2)
        factor = float(self._factors[scale])
        _move(target, np.array([column, row]), factor)
        self._resize(target, factor, view.size_wh)
        return Track(target.xywh, score=score)

    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64."""
        return flattened([self._target.kernel])

    def move_to(self, xywh: XYWH) -> None:
        """Search around `xywh`, the view's pixels, from now on."""
        target = self._target
        target.center, target.size, target.search_side = _geometry(xywh)
        target.distractors = DistractorTracker(self._has_distractors)

    def _responses(self, view: FrameView, target: _Target) -> Tensor:
        """Responses (3, 17, 17) around the last position, at the three scales."""
        crops = [
            crop_tensor(siamfc_crop(view, target.center, side, _SEARCH_SIDE, target.fill))
            for side in target.search_side * self._factors
        ]
        (responses,) = self._networks.search(np.concatenate(crops), target.kernel)
        return responses[:, 0]

    def _candidates(self, responses: Tensor, target: _Target) -> ScoredCandidates:
        """The cells of the response map at the middle scale, with their distractors."""
        (cx, cy), (w, h) = target.center.tolist(), target.size.tolist()
        positions_xy = self._points.T * target.search_side / _SEARCH_SIDE + (cx, cy)
        last = TargetState((cx, cy), (w, h))
        return target.distractors.detect(positions_xy, sigmoid(responses[1]), last)

    def _peak(self, response: Tensor) -> tuple[int, int]:
        """Row and column of the maximum of an upsampled response, with the cosine window."""
        shifted = response - response.min()
        normalized = shifted / (shifted.sum() + np.float32(1e-16))
        influence = self._parameters.window_influence
        ranked = np.float32(1 - influence) * normalized + influence * self._window
        row, column = divmod(int(ranked.argmax()), _FINE_SIDE)
        return row, column

    def _resize(self, target: _Target, factor: float, size_wh: tuple[int, int]) -> None:
        """Update the size by the best scale, unless it becomes too small or too large."""
        rate = self._parameters.scale_lr
        scale = (1 - rate) + rate * factor
        size = target.size.astype(np.float64) * scale
        too_small = scale < 1 and size.min() < _MIN_SIDE
        too_large = scale > 1 and (size > size_wh).any()
        if not too_small and not too_large:
            target.size = size.astype(np.float32)
            target.search_side *= scale


def _upsampled(responses: Tensor, is_distractor: Flags) -> Tensor:
    """Responses (3, 17, 17) -> (3, 272, 272), with the minimum in the cells of a distractor."""
    fine = np.asarray(
        [
            cv2.resize(each, (_FINE_SIDE, _FINE_SIDE), interpolation=cv2.INTER_CUBIC)
            for each in responses
        ],
        dtype=np.float32,
    )
    if is_distractor.any():
        cells = is_distractor.reshape(_SIDE, _SIDE)
        excluded = cells.repeat(_UPSAMPLING, axis=0).repeat(_UPSAMPLING, axis=1)
        fine[:, excluded] = fine.min()
    return fine


def _geometry(xywh: XYWH) -> tuple[Singles, Singles, float]:
    """Center (2,), size (2,) and side of the search region of a target with this box."""
    x, y, w, h = xywh
    center = np.array([x + (w - 1) / 2, y + (h - 1) / 2], np.float32)
    size = np.array([w, h], np.float32)
    side = _template_side(size)
    return center, size, float(side * np.float32(_SEARCH_SIDE) / np.float32(TEMPLATE_SIDE))


def _template_side(size: Singles) -> np.float32:
    """Side of the template crop of a target of size (2,), stabilized pixels, not rounded."""
    padded = size + np.float32(CONTEXT) * size.sum()
    return np.float32(np.sqrt(np.prod(padded)))


def _move(target: _Target, peak_xy: NDArray[np.int_], factor: float) -> None:
    """Move the target to the peak of a search region of `factor` times its `search_side`."""
    crop_shift = (peak_xy - (_FINE_SIDE - 1) / 2) * _STRIDE / _UPSAMPLING
    shift = crop_shift * target.search_side * factor / _SEARCH_SIDE
    target.center = (target.center.astype(np.float64) + shift).astype(np.float32)
