"""Learning from a trained NanoTrack v3: its features, scores and boxes of the same crops."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.networks.efficientnet_lite import CHANNELS
from ssiam.networks.lite import LiteResponses
from ssiam.runtime import Running
from ssiam.trackers.nanotrack import NanoTrackNetworks
from ssiam.training.losses import overlaps
from ssiam.training.settings import TeacherSettings
from ssiam.training.targets import decoded

__all__ = ["Adapter", "Lesson", "Teacher", "lesson_losses"]

_STRIDE: Final = 16  # px between the points of its maps
_FEATURES: Final = 96  # channels
_SEES: Final = 0.3  # probability from which its box counts


class Lesson(NamedTuple):
    """What the teacher says of N pairs.

    Attributes
    ----------
    template : (N, 96, 8, 8)
        Features at stride 16.
    search : (N, 96, 16, 16)
    score : (N, 15, 15)
        Probability that a point is on the target; the points are 16 px apart, the middle one on
        the crop's middle pixel.
    boxes : (N, 4, 15, 15)
        Left, top, right, bottom, px from the middle pixel.
    """

    template: Tensor
    search: Tensor
    score: Tensor
    boxes: Tensor


class Teacher:
    """A NanoTrack v3 that looks at pairs of crops.

    Parameters
    ----------
    weights : Path
        Folder of its two ONNX files.
    threads : int

    Raises
    ------
    WeightsError
        They are missing, damaged or another network's.
    """

    def __init__(self, weights: Path, threads: int) -> None:
        self._networks = NanoTrackNetworks.load("nanotrack_v3", weights, Running(threads=threads))

    def lesson(self, template: NDArray[np.uint8], search: NDArray[np.uint8]) -> Lesson:
        """What it says of crops (N, 3, 127, 127) and (N, 3, 255, 255) uint8 BGR."""
        each = [self._seen(*pair) for pair in zip(template, search, strict=True)]
        return Lesson(*(torch.from_numpy(np.concatenate(maps)) for maps in zip(*each, strict=True)))

    def _seen(
        self, template: NDArray[np.uint8], search: NDArray[np.uint8]
    ) -> tuple[NDArray[np.float32], ...]:
        (kernel,) = self._networks.template(template[None].astype(np.float32))
        (features,) = self._networks.search(search[None].astype(np.float32))
        scores, distances = self._networks.head(kernel, features)
        score = 1 / (1 + np.exp(scores[:, 0] - scores[:, 1]))
        return kernel, features, score, _boxes(distances)


class Adapter(nn.Module):
    """From the features at stride 16 to the teacher's: a 1 x 1 convolution, for training only."""

    def __init__(self) -> None:
        super().__init__()
        self.projection = nn.Conv2d(CHANNELS[-1], _FEATURES, 1)

    def forward(self, features: Tensor) -> Tensor:
        """Features (N, 96, n, n) of (N, 112, n, n)."""
        projected: Tensor = self.projection(features)
        return projected


def lesson_losses(
    lesson: Lesson,
    responses: LiteResponses,
    adapted: tuple[Tensor, Tensor],
    settings: TeacherSettings,
) -> dict[str, Tensor]:
    """How unlike the teacher's the responses are, by name, times the weights of the settings.

    Its points lie between our cells: four of these are averaged for each. `adapted` are the
    adapter's features of template and search crop.
    """
    template, search = adapted
    features = _unlike(template, lesson.template) / 2 + _unlike(search, lesson.search) / 2
    logits = _between_cells(responses.score)[:, 0]
    score = F.binary_cross_entropy_with_logits(logits, lesson.score)
    boxes = _between_cells(decoded(responses.distances))
    seen = lesson.score * (lesson.score > _SEES)
    _, giou = overlaps(boxes, lesson.boxes)
    box = ((1 - giou) * seen).sum() / seen.sum().clamp(min=1)
    return {
        "teacher_features": settings.features * features,
        "teacher_score": settings.score * score,
        "teacher_box": settings.box * box,
    }


def _unlike(features: Tensor, theirs: Tensor) -> Tensor:
    """Mean of 1 - cosine, cell by cell: features have no scale of their own."""
    return (1 - F.cosine_similarity(features, theirs, dim=1)).mean()


def _between_cells(maps: Tensor) -> Tensor:
    """Maps (N, C, 32, 32) of our cells -> (N, C, 15, 15) at the teacher's points."""
    return F.avg_pool2d(maps[:, :, 1:-1, 1:-1], 2)


def _boxes(distances: NDArray[np.float32]) -> NDArray[np.float32]:
    side = distances.shape[-1]
    at = (np.arange(side, dtype=np.float32) - side // 2) * _STRIDE
    x, y = np.meshgrid(at, at)
    left, top, right, bottom = distances.transpose(1, 0, 2, 3)
    return np.stack([x - left, y - top, x + right, y + bottom], axis=1)
