"""Labels of the response map's cells, and losses against the ground truth and a teacher."""

from __future__ import annotations

from typing import Final, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from ssiam.networks.lite import CELLS, STRIDE, LiteResponses
from ssiam.training.data.batches import Batch, TeacherResponses
from ssiam.training.settings import LossSettings, TeacherSettings

__all__ = [
    "CellLabels",
    "PairLabels",
    "Predictions",
    "cell_labels",
    "decode_boxes",
    "distillation_losses",
    "iou_and_giou",
    "lite_losses",
    "mask_losses",
    "pair_labels",
    "predictions_of",
    "to_corners",
]

_POSITIVE: Final = 0.5  # half axes of the ellipse of positive cells, relative to the box's
_IGNORED: Final = 1.0  # half axes of the ellipse outside which cells are negative, likewise
_FOCAL_ALPHA: Final = 0.25  # Lin et al., ICCV 2017, table 1b
_FOCAL_GAMMA: Final = 2.0
_MIN_AREA: Final = 1e-6  # px^2
_MIN_IOU: Final = 1e-3  # before the logarithm
_MIN_TEACHER_SCORE: Final = 0.3  # probability from which a teacher's box counts
_FAR_BELOW: Final = 1e4  # logits; its negative is below any real one


class PairLabels(NamedTuple):
    """The ground truth of N pairs: fields of `Batch` as tensors.

    Attributes
    ----------
    box : (N, 4) float32
    present : (N,) bool
    weight : (N,) float32
    """

    box: Tensor
    present: Tensor
    weight: Tensor


def pair_labels(batch: Batch, device: torch.device | None = None) -> PairLabels:
    """The ground truth of a batch as tensors on a device, by default the CPU."""
    return PairLabels(
        box=torch.from_numpy(batch.box).to(device),
        present=torch.from_numpy(batch.present).to(device),
        weight=torch.from_numpy(batch.weight).to(device),
    )


class CellLabels(NamedTuple):
    """Labels of the cells of N pairs.

    Attributes
    ----------
    positive : (N, 15, 15) bool
        On the target: high score, and the box counts.
    ignored : (N, 15, 15) bool
        Neither positive nor negative.
    """

    positive: Tensor
    ignored: Tensor


def cell_labels(box: Tensor, present: Tensor) -> CellLabels:
    """Label the cells of the response map as positive, ignored or negative.

    Cells in the ellipse with half of the box's axes are positive, as is the cell nearest to the
    box's center, so that every target in the crop has one. Other cells in the ellipse that touches
    the box's sides are ignored. All other cells are negative, as are all cells of absent targets
    (SiamBAN, Chen et al., CVPR 2020, section 3.3).

    Parameters
    ----------
    box : (N, 4) float32
        cx, cy, w, h, px of the search crop from its middle pixel.
    present : (N,) bool
    """
    centers = _cell_centers(box.device)
    cx, cy, w, h = box[:, :, None].unbind(1)  # (N, 1) each
    across = ((centers - cx) / (w / 2).clamp(min=1e-3)) ** 2  # (N, n)
    down = ((centers - cy) / (h / 2).clamp(min=1e-3)) ** 2
    radius = down[:, :, None] + across[:, None, :]  # squared, 1 on the ellipse of the box
    inside = present & (box[:, :2].abs() < CELLS * STRIDE / 2).all(dim=1)
    nearest = _nearest_cell(centers, cy)[:, :, None] & _nearest_cell(centers, cx)[:, None, :]
    positive = (radius < _POSITIVE**2) & present[:, None, None]
    positive = positive | (nearest & inside[:, None, None])
    ignored = (radius < _IGNORED**2) & present[:, None, None] & ~positive
    return CellLabels(positive, ignored)


def decode_boxes(distances: Tensor) -> Tensor:
    """Boxes of predicted distances to the target's sides.

    Parameters
    ----------
    distances : (N, 4, 15, 15)
        From each cell's center to the left, top, right and bottom, px of the crop.

    Returns
    -------
    (N, 4, 15, 15)
        Left, top, right, bottom, px of the crop from its middle pixel.
    """
    centers = _cell_centers(distances.device)
    x, y = centers[None, :].expand(CELLS, CELLS), centers[:, None].expand(CELLS, CELLS)
    left, top, right, bottom = distances.unbind(1)
    return torch.stack([x - left, y - top, x + right, y + bottom], dim=1)


def to_corners(box: Tensor) -> Tensor:
    """Left, top, right, bottom (N, 4) of boxes cx, cy, w, h (N, 4)."""
    center, half = box[:, :2], box[:, 2:] / 2
    return torch.cat([center - half, center + half], dim=1)


def _cell_centers(device: torch.device) -> Tensor:
    """Centers (15,) of the cells along an axis, px from the middle pixel."""
    return (torch.arange(CELLS, device=device) - (CELLS - 1) / 2) * STRIDE


def _nearest_cell(centers: Tensor, point: Tensor) -> Tensor:
    """Flags (N, n): which cell along an axis, with `centers` (n,), is nearest to `point` (N, 1)."""
    index = (centers - point).abs().argmin(dim=1)
    return F.one_hot(index, len(centers)).bool()


class Predictions(NamedTuple):
    """Responses of "lite" to N pairs with decoded boxes.

    Attributes
    ----------
    score, quality : (N, 15, 15)
        Logits.
    boxes : (N, 4, 15, 15)
        Left, top, right, bottom, px of the search crop from its middle pixel.
    """

    score: Tensor
    quality: Tensor
    boxes: Tensor


def predictions_of(responses: LiteResponses) -> Predictions:
    """Decode the boxes of responses, once for the losses against ground truth and teacher."""
    boxes = decode_boxes(responses.distances)
    return Predictions(responses.score[:, 0], responses.quality[:, 0], boxes)


def lite_losses(
    predictions: Predictions, labels: PairLabels, settings: LossSettings
) -> dict[str, Tensor]:
    """The losses of "lite" by name, each multiplied by its weight in the settings."""
    cells = cell_labels(labels.box, labels.present)
    logits, quality, boxes = predictions
    box_weight = labels.weight[:, None, None] * cells.positive
    iou, giou = iou_and_giou(boxes, to_corners(labels.box)[:, :, None, None])
    by_name = {
        "score": _score_loss(logits, cells, labels.weight, settings),
        "box": _weighted_mean(_box_loss(iou, giou, settings.kind_of_box), box_weight),
        "quality": _weighted_mean(_cross_entropy(quality, iou.detach()), box_weight),
        "distractor": _distractor_loss(
            logits, cells, labels.weight * labels.present, settings.margin
        ),
    }
    return {name: getattr(settings, name) * loss for name, loss in by_name.items()}


def distillation_losses(
    teacher: TeacherResponses, predictions: Predictions, settings: TeacherSettings
) -> dict[str, Tensor]:
    """Losses of "lite" against its teachers by name, multiplied by the settings' weights."""
    device = predictions.score.device
    teacher_score, teacher_boxes, weight = (torch.from_numpy(each).to(device) for each in teacher)
    entropy = _cross_entropy(predictions.score, teacher_score).mean(dim=(1, 2))
    box_weight = teacher_score * (teacher_score > _MIN_TEACHER_SCORE) * weight[:, None, None]
    _, giou = iou_and_giou(predictions.boxes, teacher_boxes)
    return {
        "teacher_score": settings.score * _weighted_mean(entropy, weight),
        "teacher_box": settings.box * _weighted_mean(1 - giou, box_weight),
    }


def mask_losses(logits: Tensor, mask: Tensor) -> dict[str, Tensor]:
    """Cross-entropy and 1 - Dice of mask logits (N, n, n) against covered fractions 0..1."""
    entropy, dice = _mask_terms(logits, mask)
    return {"mask": entropy.mean(), "dice": dice.mean()}


def iou_and_giou(boxes: Tensor, others: Tensor) -> tuple[Tensor, Tensor]:
    """IoU and generalized IoU (Rezatofighi et al., CVPR 2019) of boxes (N, 4, ...) -> (N, ...).

    Boxes are left, top, right, bottom.
    """
    shared = _area(
        torch.maximum(boxes[:, :2], others[:, :2]), torch.minimum(boxes[:, 2:], others[:, 2:])
    )
    enclosing = _area(
        torch.minimum(boxes[:, :2], others[:, :2]), torch.maximum(boxes[:, 2:], others[:, 2:])
    )
    union = _area(boxes[:, :2], boxes[:, 2:]) + _area(others[:, :2], others[:, 2:]) - shared
    iou = shared / union.clamp(min=_MIN_AREA)
    return iou, iou - (enclosing - union) / enclosing.clamp(min=_MIN_AREA)


def _cross_entropy(logits: Tensor, probability: Tensor) -> Tensor:
    """Binary cross-entropy of every logit."""
    return F.binary_cross_entropy_with_logits(logits, probability, reduction="none")


def _weighted_mean(values: Tensor, weights: Tensor) -> Tensor:
    """Weighted mean; 0 if all weights are 0."""
    return (values * weights).sum() / weights.sum().clamp(min=1)


def _area(low: Tensor, high: Tensor) -> Tensor:
    return (high - low).clamp(min=0).prod(dim=1)


def _box_loss(iou: Tensor, giou: Tensor, kind: str) -> Tensor:
    """1 - GIoU or -log IoU of each box."""
    return 1 - giou if kind == "giou" else -torch.log(iou.clamp(min=_MIN_IOU))


def _score_loss(
    logits: Tensor, cells: CellLabels, weight: Tensor, settings: LossSettings
) -> Tensor:
    """Focal or balanced loss of score logits (N, n, n); `weight` (N,) is that of the pairs."""
    positive = cells.positive.float()
    counted = weight[:, None, None] * ~cells.ignored
    entropy = _cross_entropy(logits, positive)
    if settings.kind_of_score == "balanced":
        on, off = counted * positive, counted * (1 - positive)
        return (_weighted_mean(entropy, on) + _weighted_mean(entropy, off)) / 2
    wrong = torch.where(cells.positive, 1 - logits.sigmoid(), logits.sigmoid())
    alpha = torch.where(cells.positive, _FOCAL_ALPHA, 1 - _FOCAL_ALPHA)
    focal = alpha * wrong**_FOCAL_GAMMA * entropy * counted
    return focal.sum() / (counted * positive).sum().clamp(min=1)


def _distractor_loss(logits: Tensor, cells: CellLabels, weight: Tensor, margin: float) -> Tensor:
    """Hinge loss of the best negative cell against the best positive one."""
    on = logits.masked_fill(~cells.positive, -_FAR_BELOW).amax(dim=(1, 2))
    off = logits.masked_fill(cells.positive | cells.ignored, -_FAR_BELOW).amax(dim=(1, 2))
    hinge = (margin + off - on).clamp(min=0)
    return _weighted_mean(hinge, weight * cells.positive.any(dim=2).any(dim=1))


def _mask_terms(logits: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Mean cross-entropy and 1 - Dice (N,) of each mask.

    Dice has squared terms (V-Net, Milletari et al., 3DV 2016), so that it reaches 1 for fractions
    too.
    """
    entropy = _cross_entropy(logits, mask).mean(dim=(1, 2))
    inside, both = logits.sigmoid(), (1, 2)
    shared = 2 * (inside * mask).sum(dim=both) + 1
    dice = 1 - shared / (inside.square().sum(dim=both) + mask.square().sum(dim=both) + 1)
    return entropy, dice
