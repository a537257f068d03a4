"""SiamMask and SiamMask_E: SiamRPN's loop, with a mask and a rotated box in every frame.

Wang et al., SiamMask, CVPR 2019. The loop is that of STVIR/pysot, or with ``variant="siammask"``
that of the authors (foolwood/SiamMask). The mask is only an output: the next search region depends
on the upright box.

A mask takes three steps: `refinement_windows` cuts the refinement network's inputs out of the
features around the chosen cell, `mask_probability` converts its logits to probabilities, and
`paste_mask` resamples them at their position in the frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, corners_from_xywh
from ssiam.runtime import Network, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Outline, PendingOutline, Track
from ssiam.trackers.anchors import STRIDE
from ssiam.trackers.responses import Response
from ssiam.trackers.rotated_boxes import ellipse_box, rectangle_box
from ssiam.trackers.siamese import TEMPLATE_SIDE, TargetState, clamped_state, min_size_iou
from ssiam.trackers.siamrpn import SiamRpn, SiamRpnNetworks, SiamRpnParameters

SiamMaskName: TypeAlias = Literal[
    "siammask_r50_l3",
    "siammask_e",
    "siammask_e_unrefined",
    "siammask_vot",
    "siammask_vot18",
    "siammask_davis",
]

MASK_SIDE: Final = 127  # px, side of the network's mask
# For x0, p1 and p2: padding on each side, features between neighboring cells, side of the window.
_WINDOWS: Final = ((16, 4, 61), (8, 2, 31), (4, 1, 15))


@dataclass(frozen=True)
class SiamMaskParameters(SiamRpnParameters):
    """Hyperparameters of SiamMask.

    Parameters
    ----------
    penalty_k, window_influence, lr, instance, base, variant
        As in `SiamRpnParameters`. If the mask is empty, the corners are those of the upright box,
        which is not clamped to the frame in the variant "siammask".
    mask_threshold : float
        Probability above which a pixel belongs to the target.
    fit : {"rectangle", "ellipse"}
        How the rotated box is computed: as the minimum-area rectangle around the mask, or as in
        SiamMask_E.
    factor : float, optional
        SiamMask_E's alpha in the refinement of the box; None for no refinement.
    """

    mask_threshold: float = 0.3
    fit: Literal["rectangle", "ellipse"] = "rectangle"
    factor: float | None = None


PARAMETERS: Final[dict[SiamMaskName, SiamMaskParameters]] = {
    "siammask_r50_l3": SiamMaskParameters(0.10, 0.41, 0.32, mask_threshold=0.15),
    "siammask_e": SiamMaskParameters(
        0.0997, 0.4099, 0.32, mask_threshold=0.1465, fit="ellipse", factor=0.2583
    ),
    "siammask_e_unrefined": SiamMaskParameters(
        0.0997, 0.4099, 0.32, mask_threshold=0.1465, fit="ellipse"
    ),
    "siammask_vot": SiamMaskParameters(0.04, 0.42, 0.25, variant="siammask", mask_threshold=0.30),
    "siammask_vot18": SiamMaskParameters(0.10, 0.41, 0.32, variant="siammask", mask_threshold=0.15),
    "siammask_davis": SiamMaskParameters(0.04, 0.40, 1.0, variant="siammask", mask_threshold=0.35),
}


@dataclass(frozen=True)
class SiamMaskNetworks(SiamRpnNetworks):
    """The three networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` and `search` are as in `SiamRpnNetworks`. After the two maps `search` also returns
    the correlation (1, 256, 25, 25) and the features x0 (1, 64, 125, 125), p1 (1, 256, 63, 63) and
    p2 (1, 512, 31, 31) of the backbone. `refine` maps the windows of one cell, as
    `refinement_windows` cuts them out, to logits (1, 127 * 127).
    """

    refine: Network


class SiamMask(SiamRpn):
    """SiamMask's loop.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    networks : SiamMaskNetworks
    parameters : SiamMaskParameters
    distractors : bool
        Whether objects like the target are recognized by their positions.
    """

    _networks: SiamMaskNetworks
    _parameters: SiamMaskParameters

    def __init__(
        self,
        networks: SiamMaskNetworks,
        parameters: SiamMaskParameters,
        *,
        distractors: bool = False,
    ) -> None:
        super().__init__(networks, parameters, distractors=distractors)

    def accept(self, view: FrameView, response: Response, index: int) -> Track:
        """Take a candidate as the target, with mask and corners; the score is as in `SiamRpn`."""
        last = self._target.state
        found = self._taken(response, index)
        state = self._target.state = clamped_state(found.state, view)
        # A stabilized view shows parts of the raw frame beyond its own edges.
        margin = 0 if view.is_raw else view.border
        upright = found.state if self._parameters.variant == "siammask" else state
        corr, *features = found.features
        (logits,) = self._networks.refine(*refinement_windows(corr, features, found.cell))
        instance, base = self._parameters.instance, self._parameters.base
        square = mask_square(last.center_xy, found.crop_side, found.cell, instance, base)
        outline = PendingOutline(
            partial(_outline, logits, square, upright, view.size_wh, margin, self._parameters)
        )
        score = found.score * min_size_iou(state, found.size_wh)
        return Track(state.xywh, score=score, corners=outline, mask=outline)


def _outline(
    logits: Tensor,
    square_xywh: XYWH,
    upright: TargetState,
    size_wh: tuple[int, int],
    margin: int,
    parameters: SiamMaskParameters,
) -> Outline:
    """Mask and rotated box in the view's pixels; without a mask the corners of `upright`."""
    pasted = paste_mask(mask_probability(logits), square_xywh, size_wh, margin)
    mask = pasted > parameters.mask_threshold
    ellipse = parameters.fit == "ellipse"
    box = ellipse_box(mask, parameters.factor) if ellipse else rectangle_box(mask)
    corners = corners_from_xywh(upright.xywh) if box is None else box - margin
    width, height = size_wh
    return Outline(corners, mask[margin : margin + height, margin : margin + width])


def refinement_windows(
    corr: Tensor, features: Sequence[Tensor], cell: tuple[int, int]
) -> list[Tensor]:
    """Inputs of the refinement network for one cell (row, column) of the response map.

    Parameters
    ----------
    corr : (1, 256, 25, 25) float32
        Correlation of template and search region.
    features : (1, 64, 125, 125), (1, 256, 63, 63) and (1, 512, 31, 31) float32
        The backbone's x0, p1 and p2 of the search region.
    cell : (int, int)
        Row and column of the response map.

    Returns
    -------
    (1, 64, 61, 61), (1, 256, 31, 31), (1, 512, 15, 15) and (1, 256, 1, 1) float32
        Windows of x0, p1 and p2, zero outside of the region, and the cell's correlation.
    """
    row, column = cell
    windows = [
        _window(each, row * step - pad, column * step - pad, side)
        for each, (pad, step, side) in zip(features, _WINDOWS, strict=True)
    ]
    return [*windows, np.ascontiguousarray(corr[:, :, row : row + 1, column : column + 1])]


def _window(features: Tensor, top: int, left: int, side: int) -> Tensor:
    """Square of `side` from (top, left), padded with zeros outside of the features."""
    height, width = features.shape[2:]
    window = np.zeros((*features.shape[:2], side, side), np.float32)
    y0, y1 = max(top, 0), min(top + side, height)
    x0, x1 = max(left, 0), min(left + side, width)
    window[:, :, y0 - top : y1 - top, x0 - left : x1 - left] = features[:, :, y0:y1, x0:x1]
    return window


def mask_probability(logits: Tensor) -> Tensor:
    """Sigmoid of logits (1, 127 * 127), row by row -> (127, 127) float32."""
    half = logits.reshape(MASK_SIDE, MASK_SIDE).astype(np.float64) / 2
    return np.asarray((1 + np.tanh(half)) / 2, dtype=np.float32)


def mask_square(
    center_xy: tuple[float, float], crop_side: int, cell: tuple[int, int], instance: int, base: int
) -> XYWH:
    """The square (x, y, w, h) of the frame that the mask of one cell covers.

    Parameters
    ----------
    center_xy : (x, y)
        Center of the search region, in the same pixels as the result.
    crop_side : int
        Side of the search region, in the same pixels.
    cell : (int, int)
        Row and column of the response map.
    instance, base : int
        As in `SiamRpnParameters`.
    """
    scale = crop_side / instance
    row, column = ((index - base // 2) * STRIDE * scale for index in cell)
    left, top = (c - crop_side / 2 for c in center_xy)
    return left + column, top + row, TEMPLATE_SIDE * scale, TEMPLATE_SIDE * scale


def paste_mask(
    mask: Tensor, square_xywh: XYWH, size_wh: tuple[int, int], margin: int = 0
) -> Tensor:
    """A mask resampled at its position in the frame, with zeros around it.

    As in the reference (`crop_back` of pysot), the result is smaller by the factor
    (size - 1) / size, where size is that of the frame.

    Parameters
    ----------
    mask : (127, 127) float32
    square_xywh : (x, y, w, h)
        The square that the mask covers, pixels of the frame.
    size_wh : (int, int)
        The frame's width and height.
    margin : int
        Pixels added to the frame on each side, to which the mask extends.

    Returns
    -------
    (H + 2 * margin, W + 2 * margin) float32
    """
    width, height = size_wh
    whole = (width + 2 * margin, height + 2 * margin)
    shifted = _frame_from_mask(square_xywh, size_wh) + np.array([0.0, 0.0, margin])
    return np.asarray(
        cv2.warpAffine(mask, shifted, whole, flags=cv2.INTER_LINEAR), dtype=np.float32
    )


def _frame_from_mask(square_xywh: XYWH, size_wh: tuple[int, int]) -> NDArray[np.float64]:
    """Transform (2, 3) from mask to frame, in the reference's order of operations."""
    x, y, w, _ = square_xywh
    zoom = MASK_SIDE / w
    scales = [(length - 1) / (length * zoom) for length in size_wh]
    shifts = [scale * (start * zoom) for scale, start in zip(scales, (x, y), strict=True)]
    return np.array([[scales[0], 0.0, shifts[0]], [0.0, scales[1], shifts[1]]])
