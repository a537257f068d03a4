"""Trained trackers as teachers: responses of NanoTrack v3 and FEAR-XS to pairs of crops.

NanoTrack v3 separates the target better from distractors of its kind; FEAR-XS (Borsuk et al., ECCV
2022) is better on faces, vehicles and targets that change their appearance. The processes that load
batches add the responses of the better teacher for each pair.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.networks.lite import CELLS, STRIDE
from ssiam.runtime import RuntimeOptions, load_network
from ssiam.runtime.openvino import supports_bf16
from ssiam.trackers.nanotrack import NanoTrackNetworks
from ssiam.training.data.batches import Batch, TeacherResponses
from ssiam.training.data.pairs import PairSampler
from ssiam.training.settings import TeacherSettings

__all__ = ["DistillationSampler", "Teachers"]

Bytes: TypeAlias = NDArray[np.uint8]
Floats: TypeAlias = NDArray[np.float32]

# Centers (15,) of the cells along an axis, px from the search crop's middle pixel.
_CELL_CENTERS: Final = (np.arange(CELLS) - CELLS // 2) * float(STRIDE)

# FEAR-XS's crops, as in the authors' code (github.com/PinataFarms/FEARTracker, MIT).
_FEAR_TEMPLATE: Final = 128  # px, side of its template crop
_FEAR_SEARCH: Final = 256  # px, side of its search crop
_FEAR_STRIDE: Final = 16  # px between its cells
_FEAR_CENTER: Final = 8  # the cell whose center is the crop's center
_FEAR_TEMPLATE_SIZE: Final = 1.4  # side of its template region, in sizes of the target
_FEAR_SEARCH_SIZE: Final = 5.0  # side of its search region, in sizes of the target
_FEAR_MEAN: Final = np.array([123.675, 116.28, 103.53], dtype=np.float32)  # RGB
_FEAR_MIN_SIDE: Final = 4.0  # px; smaller targets have the regions of this size


class _Response(NamedTuple):
    """Probabilities (15, 15) and boxes (4, 15, 15) of one teacher for one pair."""

    score: Floats
    boxes: Floats


class Teachers:
    """NanoTrack v3 and, optionally, FEAR-XS; for each pair the better one is the teacher.

    Parameters
    ----------
    settings : TeacherSettings
    threads : int

    Raises
    ------
    WeightsError
        Their files are missing, damaged or of other networks.
    """

    def __init__(self, settings: TeacherSettings, threads: int = 1) -> None:
        options = RuntimeOptions(threads=threads, precision="bf16" if supports_bf16() else "f32")
        self._min_overlap = settings.agreement
        self._nanotrack = _NanoTrackTeacher(Path(settings.weights), options)
        self._fear = None if settings.fear is None else _FearTeacher(Path(settings.fear), options)

    def responses(self, batch: Batch) -> TeacherResponses:
        """For each pair, the responses of the teacher whose best box is closest to the true one.

        The weight is 0 where the target is absent, or no best box has the minimum overlap.
        """
        found = [self._best(batch, index) for index in range(len(batch))]
        scores, boxes, weights = zip(*found, strict=True)
        return TeacherResponses(np.stack(scores), np.stack(boxes), np.array(weights, np.float32))

    def _best(self, batch: Batch, index: int) -> tuple[Floats, Floats, float]:
        if batch.present[index]:
            truth = batch.box[index]
            responses = self._respond(batch, index)
            overlap, best = max(
                ((_best_overlap(each, truth), each) for each in responses),
                key=lambda scored: scored[0],
            )
            if overlap >= self._min_overlap:
                return best.score, best.boxes, 1.0
        return (
            np.zeros((CELLS, CELLS), dtype=np.float32),
            np.zeros((4, CELLS, CELLS), dtype=np.float32),
            0.0,
        )

    def _respond(self, batch: Batch, index: int) -> list[_Response]:
        template, search = batch.template[index], batch.search[index]
        responses = [self._nanotrack(template, search)]
        if self._fear is not None and batch.template_wh is not None:
            sizes = batch.template_wh[index], batch.box[index, 2:]
            responses.append(self._fear(template, search, *sizes))
        return responses


class DistillationSampler:
    """Batches of pairs with the responses of teachers.

    Each process loads the teachers when it draws its first batch, as compiled networks cannot be
    pickled.

    Parameters
    ----------
    pairs : PairSampler
    settings : TeacherSettings
    """

    def __init__(self, pairs: PairSampler, settings: TeacherSettings) -> None:
        self._pairs, self._settings = pairs, settings
        self._teachers: Teachers | None = None

    def batch(self, step: int, size: int) -> Batch:
        """The first `size` pairs of a step; raises as `PairSampler.batch` and `Teachers`."""
        if self._teachers is None:
            self._teachers = Teachers(self._settings)
        batch = self._pairs.batch(step, size)
        batch.teacher = self._teachers.responses(batch)
        return batch


class _NanoTrackTeacher:
    """NanoTrack v3 on pairs of crops."""

    def __init__(self, weights: Path, options: RuntimeOptions) -> None:
        self._networks = NanoTrackNetworks.load("nanotrack_v3", weights, options)

    def __call__(self, template: Bytes, search: Bytes) -> _Response:
        """Response to crops (3, 127, 127) and (3, 255, 255) BGR."""
        (kernel,) = self._networks.template(template[None].astype(np.float32))
        (features,) = self._networks.search(search[None].astype(np.float32))
        scores, distances = self._networks.head(kernel, features)
        score = 1 / (1 + np.exp(scores[0, 0] - scores[0, 1]))
        return _Response(score, _boxes(distances[0], *np.meshgrid(_CELL_CENTERS, _CELL_CENTERS)))


class _FearTeacher:
    """FEAR-XS on crops that were cut for other networks.

    FEAR-XS stretches its regions to squares. Its crops are resampled from the given ones, and its
    maps are resampled to the cells of "lite".
    """

    def __init__(self, weights: Path, options: RuntimeOptions) -> None:
        self._template, self._search = (
            load_network(
                weights / f"fear_{piece}.onnx",
                threads=options.threads,
                precision=options.precision,
            )
            for piece in ("template", "search")
        )

    def __call__(
        self, template: Bytes, search: Bytes, template_wh: Floats, search_wh: Floats
    ) -> _Response:
        """Response to crops (3, 127, 127) and (3, 255, 255) BGR.

        `template_wh` and `search_wh` (2,) are the sizes of the target in them, px.
        """
        template_wh = np.maximum(template_wh, _FEAR_MIN_SIDE)
        search_wh = np.maximum(search_wh, _FEAR_MIN_SIDE)
        template_crop = _stretched(template, template_wh * _FEAR_TEMPLATE_SIZE, _FEAR_TEMPLATE)
        (features,) = self._template(template_crop)
        region_wh = search_wh * _FEAR_SEARCH_SIZE
        outputs = self._search(_stretched(search, region_wh, _FEAR_SEARCH), features)
        by_channels = {each.shape[1]: each[0] for each in outputs}
        scale = (region_wh / _FEAR_SEARCH).astype(np.float32)
        return _resampled(by_channels[1][0], by_channels[4], scale)


def _resampled(logits: Floats, distances: Floats, scale: Floats) -> _Response:
    """FEAR-XS's maps (16, 16) and (4, 16, 16) at the cells of "lite".

    `scale` (2,) is px of the search crop per px of FEAR-XS's crop, in x and y.
    """
    columns, rows = (_CELL_CENTERS / (each * _FEAR_STRIDE) + _FEAR_CENTER for each in scale)
    x, y = (each.astype(np.float32) for each in np.meshgrid(columns, rows))
    probability = np.asarray(1 / (1 + np.exp(-logits)), dtype=np.float32)
    score = cv2.remap(probability, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    last = logits.shape[0] - 1
    near_x, near_y = (np.clip(np.rint(each), 0, last).astype(int) for each in (x, y))
    sides = distances[:, near_y, near_x] * np.tile(scale, 2)[:, None, None]
    at_x, at_y = (
        (near - _FEAR_CENTER) * _FEAR_STRIDE * each
        for near, each in zip((near_x, near_y), scale, strict=True)
    )
    return _Response(np.asarray(score, dtype=np.float32), _boxes(sides, at_x, at_y))


def _stretched(crop: Bytes, size_wh: Floats, out: int) -> Floats:
    """The middle (width, height) px of a crop (3, S, S) BGR as (1, 3, out, out) RGB minus the mean.

    Beyond the crop's border it is filled with the crop's mean color.
    """
    image: Image = np.ascontiguousarray(crop.transpose(1, 2, 0))
    scale_x, scale_y = size_wh / out
    middle = (crop.shape[-1] - 1) / 2
    crop_from_out = np.array(
        [
            [scale_x, 0, middle - out / 2 * scale_x],
            [0, scale_y, middle - out / 2 * scale_y],
        ]
    )
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped = cv2.warpAffine(
        image, crop_from_out, (out, out), flags=flags, borderValue=cv2.mean(image)[:3]
    )
    rgb = warped[..., ::-1].astype(np.float32) - _FEAR_MEAN
    return np.ascontiguousarray(rgb.transpose(2, 0, 1)[None])


def _boxes(distances: Floats, x: NDArray[np.floating], y: NDArray[np.floating]) -> Floats:
    """Left, top, right, bottom (4, n, n) from distances (4, n, n) and cell centers (n, n)."""
    left, top, right, bottom = distances
    return np.stack([x - left, y - top, x + right, y + bottom]).astype(np.float32)


def _best_overlap(response: _Response, truth: Floats) -> float:
    """IoU of the box at the maximum score with the true one: cx, cy, w, h (4,)."""
    row, column = np.unravel_index(int(np.argmax(response.score)), response.score.shape)
    box = response.boxes[:, row, column]
    low, high = truth[:2] - truth[2:] / 2, truth[:2] + truth[2:] / 2
    shared = np.prod(np.clip(np.minimum(box[2:], high) - np.maximum(box[:2], low), 0, None))
    area = np.prod(np.clip(box[2:] - box[:2], 0, None)) + np.prod(truth[2:]) - shared
    return float(shared / max(area, 1e-6))
