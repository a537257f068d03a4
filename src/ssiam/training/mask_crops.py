"""`MaskSampler`: crops of targets in their boxes, with their masks, for `BoxMaskNetwork`."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import DatasetError
from ssiam.errors import SsiamError
from ssiam.geometry import Image
from ssiam.networks.box_mask import BOX_MASK_CELLS, BOX_MASK_CONTEXT, BOX_MASK_CROP
from ssiam.training.augment import changed, coarsened, covered, greyed
from ssiam.training.choosing import Chooser, Shot
from ssiam.training.crops import Window, centre_of, crop_mask, crop_picture
from ssiam.training.pair_settings import PairSettings
from ssiam.training.sources import Mask, Source

__all__ = ["MaskBatch", "MaskSampler", "box_window"]

_log = logging.getLogger(__name__)

_TRIES: Final = 100  # targets drawn for one crop before it is said that there are none
_TURNED: Final = 8.0  # degrees, standard deviation of the roll
# How far a tracker's boxes are off: standard deviations of the center, in sizes of the target, and
# of the log of each side; both are cut off at twice that.
_SHIFT: Final = 0.06
_SCALE: Final = 0.13
_COARSE: Final = (1.5, 6.0)  # factors of `coarsened`
_LEAST: Final = 0.05  # share of a crop's cells that the target covers


@dataclass
class MaskBatch:
    """N crops with their masks.

    Attributes
    ----------
    crop : (N, 3, 128, 128) uint8 BGR
    mask : (N, 64, 64) uint8
        Covered share of cells of 2 x 2 px, 0..255.
    """

    crop: NDArray[np.uint8]
    mask: NDArray[np.uint8]

    def __len__(self) -> int:
        """Number of crops."""
        return len(self.crop)


class MaskSampler:
    """Draws crops of targets that have a mask; images that cannot be read are passed.

    Parameters
    ----------
    sources : sequence of Source
    settings : PairSettings
        `augment`, and `turned` of the windows.
    seed : int
        The same seed gives the same crops, whoever draws them and in whatever order.

    Raises
    ------
    ArgumentError
        No source has a weight.
    """

    def __init__(
        self, sources: Sequence[Source], settings: PairSettings | None = None, seed: int = 0
    ) -> None:
        self._settings = settings or PairSettings()
        self._chooser = Chooser(sources, 0)
        self._seed = seed

    def batch(self, step: int, size: int) -> MaskBatch:
        """The crops of a step.

        Raises
        ------
        DatasetError
            The sources show no target with a mask in a hundred draws.
        """
        crops, masks = zip(*[self._drawn(step, place) for place in range(size)], strict=True)
        planes = np.ascontiguousarray(np.stack(crops).transpose(0, 3, 1, 2))
        return MaskBatch(planes, np.stack(masks))

    def _drawn(self, step: int, place: int) -> tuple[Image, NDArray[np.uint8]]:
        rng = np.random.default_rng([self._seed, step, place])
        for _ in range(_TRIES):
            try:
                shot = self._chooser.first(rng)
                mask = None if shot is None else shot.track.mask(shot.t)
                if shot is not None and mask is not None and mask.any():
                    found = self._cut(shot, mask, rng)
                    if found[1].mean() > 255 * _LEAST:
                        return found
            except SsiamError as error:
                _log.warning("%s; left out", error)
        raise DatasetError(f"training data: {_TRIES} draws show no target with a mask")

    def _cut(
        self, shot: Shot, mask: Mask, rng: np.random.Generator
    ) -> tuple[Image, NDArray[np.uint8]]:
        augment, any_angle = self._settings.augment, self._settings.windows.turned
        angle = rng.uniform(-180, 180) if rng.random() < any_angle else _TURNED * rng.normal()
        mirrored = bool(rng.random() < augment.flip)
        off = np.clip(rng.normal(size=2), -2, 2) * _SHIFT
        scale = np.exp(np.clip(rng.normal(size=2), -2, 2) * _SCALE)
        window = _varied_window(shot, mask, float(np.deg2rad(angle)), mirrored, off, scale)
        crop, coverage = crop_picture(shot.image, window), crop_mask(mask, window)
        if rng.random() < augment.cover:
            middle = BOX_MASK_CROP / BOX_MASK_CONTEXT
            crop, hidden = covered(crop, np.array([0.0, 0.0, middle, middle]), rng)
            coverage[hidden] = 0
        crop = changed(crop, augment, rng)
        if rng.random() < augment.small:
            crop = coarsened(crop, rng.uniform(*_COARSE))
        if rng.random() < augment.grey:
            crop = greyed(crop)
        side = (BOX_MASK_CELLS, BOX_MASK_CELLS)
        cells = cv2.resize(coverage, side, interpolation=cv2.INTER_AREA)
        return crop, np.asarray(cells, dtype=np.uint8)


def box_window(center_xy: tuple[float, float], size_wh: tuple[float, float]) -> Window:
    """The window of 128 px that shows a box 1.6 times as wide and as high, stretched to a square.

    The center counts pixels at their centers.
    """
    w, h = size_wh
    side = BOX_MASK_CONTEXT * float(np.sqrt(w * h))
    return Window(center_xy, side, BOX_MASK_CROP, stretch=float(np.sqrt(w / h)))


def _varied_window(
    shot: Shot,
    mask: Mask,
    angle: float,
    mirrored: bool,
    off: NDArray[np.float64],
    scale: NDArray[np.float64],
) -> Window:
    """The window of the box of a turned mask, shifted by `off` sizes and scaled."""
    upright = Window(centre_of(shot.xywh), 1.0, 1, angle=angle, mirrored=mirrored)
    box = upright.seen_of(mask)
    center = upright.crop_from_frame[:2, :2].T @ (box[:2] + off * box[2:])
    at = (upright.center_xy[0] + float(center[0]), upright.center_xy[1] + float(center[1]))
    w, h = (box[2:] * scale).tolist()
    return replace(box_window(at, (w, h)), angle=angle, mirrored=mirrored)
