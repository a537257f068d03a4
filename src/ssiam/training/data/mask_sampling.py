"""`MaskSampler`: crops of targets in their boxes with their masks, for `BoxMaskNetwork`."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import DatasetError
from ssiam.errors import SsiamError
from ssiam.geometry import Image
from ssiam.networks.box_mask import BOX_MASK_CELLS, BOX_MASK_CONTEXT, BOX_MASK_CROP
from ssiam.training.data.augment import augment_crop, coarsen, occlude, to_grayscale
from ssiam.training.data.batches import MaskBatch, planes
from ssiam.training.data.crops import CropRegion, center_of, crop_image, crop_mask
from ssiam.training.data.masks import Mask
from ssiam.training.data.sampling import TargetFrame, TargetSampler
from ssiam.training.data.settings import PairSettings
from ssiam.training.data.tracks import Source

__all__ = ["MaskSampler"]

_log = logging.getLogger(__name__)

_TRIES: Final = 100  # targets drawn for one crop before it fails
_ROTATION: Final = 8.0  # degrees, standard deviation
# Errors of a tracker's boxes, clipped at two standard deviations: of the center, in sizes of the
# target, and of the log of each side.
_SHIFT: Final = 0.06
_SCALE: Final = 0.13
_COARSE: Final = (1.5, 6.0)  # factors of `coarsen`
_MIN_COVERED: Final = 0.05  # fraction of a crop's cells that the target covers


class MaskSampler:
    """Samples crops of targets with a mask. Damaged images are skipped with a warning.

    Parameters
    ----------
    sources : sequence of Source
    settings : PairSettings, optional
        Only `augment` and `windows.turned` are used.
    seed : int
        The same seed gives the same crops, in any process and any order.

    Raises
    ------
    ArgumentError
        No source has a weight above 0.
    """

    def __init__(
        self, sources: Sequence[Source], settings: PairSettings | None = None, seed: int = 0
    ) -> None:
        self._settings = settings or PairSettings()
        self._targets = TargetSampler(sources, 0)
        self._seed = seed

    def batch(self, step: int, size: int) -> MaskBatch:
        """The first `size` crops of a step.

        Raises
        ------
        DatasetError
            A hundred draws found no target with a mask.
        """
        crops, masks = zip(*[self._crop(step, index) for index in range(size)], strict=True)
        return MaskBatch(planes(crops), np.stack(masks))

    def _crop(self, step: int, index: int) -> tuple[Image, NDArray[np.uint8]]:
        rng = np.random.default_rng([self._seed, step, index])
        for _ in range(_TRIES):
            try:
                target = self._targets.draw(rng)
                mask = None if target is None else target.track.mask(target.t)
                if target is not None and mask is not None and mask.any():
                    crop, cells = self._cut(target, mask, rng)
                    if cells.mean() > 255 * _MIN_COVERED:
                        return crop, cells
            except SsiamError as error:
                _log.warning("%s; left out", error)
        raise DatasetError(f"training data: {_TRIES} draws show no target with a mask")

    def _cut(
        self, target: TargetFrame, mask: Mask, rng: np.random.Generator
    ) -> tuple[Image, NDArray[np.uint8]]:
        """A crop (128, 128, 3) and the coverage (64, 64) of its cells, 0..255."""
        augment = self._settings.augment
        region = self._random_region(target, mask, rng)
        crop, coverage = crop_image(target.image, region), crop_mask(mask, region)
        if rng.random() < augment.cover:
            side = BOX_MASK_CROP / BOX_MASK_CONTEXT
            crop, occluded = occlude(crop, np.array([0.0, 0.0, side, side]), rng)
            coverage[occluded] = 0
        crop = augment_crop(crop, augment, rng)
        if rng.random() < augment.small:
            crop = coarsen(crop, rng.uniform(*_COARSE))
        if rng.random() < augment.grey:
            crop = to_grayscale(crop)
        cells = cv2.resize(coverage, (BOX_MASK_CELLS, BOX_MASK_CELLS), interpolation=cv2.INTER_AREA)
        return crop, np.asarray(cells, dtype=np.uint8)

    def _random_region(
        self, target: TargetFrame, mask: Mask, rng: np.random.Generator
    ) -> CropRegion:
        """The region around the box of the rotated mask, with the errors of a tracker's boxes."""
        settings = self._settings
        any_angle = rng.random() < settings.windows.turned
        degrees = rng.uniform(-180, 180) if any_angle else _ROTATION * rng.normal()
        angle = float(np.deg2rad(degrees))
        mirrored = bool(rng.random() < settings.augment.flip)
        shift = np.clip(rng.normal(size=2), -2, 2) * _SHIFT
        scale = np.exp(np.clip(rng.normal(size=2), -2, 2) * _SCALE)
        rotated = CropRegion(center_of(target.xywh), 1.0, 1, angle=angle, mirrored=mirrored)
        box = rotated.mask_box_in_crop(mask)
        offset = rotated.crop_from_frame[:2, :2].T @ (box[:2] + shift * box[2:])
        (x, y), (dx, dy) = rotated.center_xy, offset.tolist()
        w, h = (box[2:] * scale).tolist()
        return replace(_box_region((x + dx, y + dy), (w, h)), angle=angle, mirrored=mirrored)


def _box_region(center_xy: tuple[float, float], size_wh: tuple[float, float]) -> CropRegion:
    """The region of a box enlarged 1.6 times, stretched to a square crop of 128 px."""
    w, h = size_wh
    side = BOX_MASK_CONTEXT * float(np.sqrt(w * h))
    return CropRegion(center_xy, side, BOX_MASK_CROP, stretch=float(np.sqrt(w / h)))
