"""What NanoTrack v3 and FEAR-XS say of pairs of crops, and which of the two is to be learned from.

NanoTrack v3 holds the target among others of its kind; FEAR-XS (Borsuk et al., ECCV 2022) is
better on faces, vehicles and whatever changes its appearance. Where the truth is known, the one
whose best box agrees with it is right about the pair. FEAR-XS stretches what it looks at; its crops
are cut out of ours, and its maps are brought back to our cells.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.networks.lite2 import CELLS, STRIDE
from ssiam.runtime import Running, load_network
from ssiam.runtime.openvino import computes_in_bf16
from ssiam.trackers.nanotrack import NanoTrackNetworks
from ssiam.training.batches import Batch, Lessons
from ssiam.training.pairs import PairSampler
from ssiam.training.settings import TeacherSettings

__all__ = ["TaughtSampler", "Tutors"]

Floats = NDArray[np.float32]

# FEAR-XS, as its authors feed it (github.com/PinataFarms/FEARTracker, MIT).
_FEAR_TEMPLATE: Final = 128  # px, side of its template crop
_FEAR_SEARCH: Final = 256  # px, side of its search crop
_FEAR_STRIDE: Final = 16  # px between its cells
_FEAR_CENTER: Final = 8  # the cell whose center lies on the crop's
_FEAR_TEMPLATE_SIZE: Final = 1.4  # times the target's width and height
_FEAR_SEARCH_SIZE: Final = 5.0  # likewise
_FEAR_MEAN: Final = np.array([123.675, 116.28, 103.53], dtype=np.float32)  # RGB
_LEAST: Final = 4.0  # px, side of a target that it can be shown


class _Seen(NamedTuple):
    """One network's probability (15, 15) and boxes (4, 15, 15) of a pair."""

    score: Floats
    boxes: Floats


class Tutors:
    """The trained networks.

    Parameters
    ----------
    settings : TeacherSettings
    threads : int

    Raises
    ------
    WeightsError
        They are missing, damaged or other networks'.
    """

    def __init__(self, settings: TeacherSettings, threads: int = 1) -> None:
        self._agreement = settings.agreement
        running = Running(threads=threads, precision="bf16" if computes_in_bf16() else "f32")
        self._nano = NanoTrackNetworks.load("nanotrack_v3", Path(settings.weights), running)
        self._fear = None if settings.fear is None else _Fear(Path(settings.fear), running)

    def lessons(self, batch: Batch) -> Lessons:
        """What is to be learned of a batch's pairs."""
        found = [self._lesson(batch, index) for index in range(len(batch))]
        scores, boxes, weights = zip(*found, strict=True)
        return Lessons(np.stack(scores), np.stack(boxes), np.array(weights, dtype=np.float32))

    def _lesson(self, batch: Batch, index: int) -> tuple[Floats, Floats, float]:
        """Score and boxes of the tutor that is right, and 1; zeros if none is."""
        if batch.present[index]:
            truth = batch.box[index]
            overlap, seen = max(
                ((_best_overlap(seen, truth), seen) for seen in self._seen(batch, index)),
                key=lambda each: each[0],
            )
            if overlap >= self._agreement:
                return seen.score, seen.boxes, 1.0
        return (
            np.zeros((CELLS, CELLS), dtype=np.float32),
            np.zeros((4, CELLS, CELLS), dtype=np.float32),
            0.0,
        )

    def _seen(self, batch: Batch, index: int) -> list[_Seen]:
        template, search = batch.template[index], batch.search[index]
        seen = [self._nano_seen(template, search)]
        if self._fear is not None and batch.template_wh is not None:
            sizes = batch.template_wh[index], batch.box[index, 2:]
            seen.append(self._fear.seen(template, search, *sizes))
        return seen

    def _nano_seen(self, template: NDArray[np.uint8], search: NDArray[np.uint8]) -> _Seen:
        (kernel,) = self._nano.template(template[None].astype(np.float32))
        (features,) = self._nano.search(search[None].astype(np.float32))
        scores, distances = self._nano.head(kernel, features)
        score = 1 / (1 + np.exp(scores[0, 0] - scores[0, 1]))
        return _Seen(score, _boxes(distances[0], *np.meshgrid(_AT, _AT)))


class TaughtSampler:
    """Batches of pairs with what the tutors say of them.

    Each process that draws loads the tutors for itself, when it draws first.

    Parameters
    ----------
    sampler : PairSampler
    settings : TeacherSettings
    """

    def __init__(self, sampler: PairSampler, settings: TeacherSettings) -> None:
        self._sampler, self._settings = sampler, settings
        self._tutors: Tutors | None = None

    def batch(self, step: int, size: int) -> Batch:
        """The pairs of a step; raises as `PairSampler.batch` and `Tutors`."""
        if self._tutors is None:
            self._tutors = Tutors(self._settings)
        batch = self._sampler.batch(step, size)
        batch.lessons = self._tutors.lessons(batch)
        return batch


class _Fear:
    """FEAR-XS on crops that were cut for other networks."""

    def __init__(self, weights: Path, running: Running) -> None:
        self._template, self._search = (
            load_network(
                weights / f"fear_{piece}.onnx",
                threads=running.threads,
                precision=running.precision,
            )
            for piece in ("template", "search")
        )

    def seen(
        self,
        template: NDArray[np.uint8],
        search: NDArray[np.uint8],
        template_wh: Floats,
        search_wh: Floats,
    ) -> _Seen:
        """What it sees in crops (3, 127, 127) and (3, 255, 255) BGR.

        `template_wh` and `search_wh` (2,) are the sizes of the target in them, pixels.
        """
        template_wh, search_wh = np.maximum(template_wh, _LEAST), np.maximum(search_wh, _LEAST)
        look = _stretched(template, template_wh * _FEAR_TEMPLATE_SIZE, _FEAR_TEMPLATE)
        (features,) = self._template(look)
        region = search_wh * _FEAR_SEARCH_SIZE
        outputs = self._search(_stretched(search, region, _FEAR_SEARCH), features)
        by_channels = {each.shape[1]: each[0] for each in outputs}
        scale = (region / _FEAR_SEARCH).astype(np.float32)
        return _on_our_cells(by_channels[1][0], by_channels[4], scale)


def _on_our_cells(logits: Floats, distances: Floats, scale: Floats) -> _Seen:
    """FEAR-XS's maps (16, 16) and (4, 16, 16) at our cells; `scale` (2,): our px for its px."""
    columns, rows = (_AT / (each * _FEAR_STRIDE) + _FEAR_CENTER for each in scale)
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
    return _Seen(np.asarray(score, dtype=np.float32), _boxes(sides, at_x, at_y))


def _stretched(crop: NDArray[np.uint8], size_wh: Floats, out: int) -> Floats:
    """The middle (width, height) px of a crop (3, S, S) BGR as (1, 3, out, out) RGB less its mean.

    Beyond the crop is its mean color.
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
    """Left, top, right, bottom (4, n, n) of distances from points (n, n)."""
    left, top, right, bottom = distances
    return np.stack([x - left, y - top, x + right, y + bottom]).astype(np.float32)


def _best_overlap(seen: _Seen, truth: Floats) -> float:
    """IoU of the box of the best cell with the true one: cx, cy, w, h (4,)."""
    best = np.unravel_index(int(np.argmax(seen.score)), seen.score.shape)
    box = seen.boxes[:, best[0], best[1]]
    low, high = truth[:2] - truth[2:] / 2, truth[:2] + truth[2:] / 2
    shared = np.prod(np.clip(np.minimum(box[2:], high) - np.maximum(box[:2], low), 0, None))
    area = np.prod(np.clip(box[2:] - box[:2], 0, None)) + np.prod(truth[2:]) - shared
    return float(shared / max(area, 1e-6))


_AT: Final = (np.arange(CELLS) - CELLS // 2) * float(STRIDE)  # centers of our cells along an axis
