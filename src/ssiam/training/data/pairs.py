"""`PairSampler`: pairs of a template and a search crop, a pure function of seed, step and index."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import DatasetError
from ssiam.errors import SsiamError
from ssiam.geometry import Image
from ssiam.training.data.augment import (
    NO_SHAKE,
    Shake,
    augment_crop,
    coarsen,
    draw_shake,
    motion_blur,
    occlude,
    to_grayscale,
)
from ssiam.training.data.batches import TEMPLATE_CROP, Batch, Pair, collate
from ssiam.training.data.crops import (
    CropRegion,
    center_of,
    crop_image,
    excludes,
    random_background_region,
    random_negative_region,
    random_search_region,
    random_template_region,
    region_around,
)
from ssiam.training.data.images import image_size
from ssiam.training.data.sampling import TargetFrame, TargetSampler
from ssiam.training.data.settings import PairSettings
from ssiam.training.data.tracks import Source

__all__ = ["PairSampler"]

_log = logging.getLogger(__name__)

_TRIES: Final = 100  # targets drawn for one pair before it fails
# Variation of recent templates relative to templates: a tracker cuts them at its own boxes.
_RECENT_VARIATION: Final = 2.5
_RECENT_REACH: Final = 4  # recent templates are drawn within `reach` divided by this
_SMALL: Final = (12.0, 32.0)  # px of the frame, side of a small target
_TEMPLATE_SHAKE: Final = 0.25  # probability of a blurred template, relative to search crops


@dataclass(frozen=True, eq=False)
class _SearchSample:
    """A search crop before it is cut.

    Attributes
    ----------
    frame : TargetFrame
        The frame, and the object in it that the region is aimed at.
    region : CropRegion
    shake : Shake
    present : bool
        Whether the object is the target; otherwise the crop does not show the target.
    background : (255, 255, 3) uint8, optional
        Content beyond the frame border.
    any_angle : bool
        Whether the region is rotated by an arbitrary angle; the target then has a mask.
    """

    frame: TargetFrame
    region: CropRegion
    shake: Shake
    present: bool
    background: Image | None = None
    any_angle: bool = False

    @property
    def box(self) -> NDArray[np.float64] | None:
        """The target's box cx, cy, w, h (4,), px of the crop from its middle pixel."""
        if not self.present:
            return None
        mask = self.frame.track.mask(self.frame.t) if self.any_angle else None
        if mask is None:
            return self.region.box_in_crop(self.frame.xywh)
        return self.region.mask_box_in_crop(mask)


class PairSampler:
    """Samples pairs of crops. Damaged images are skipped with one warning each.

    Threads: one thread at a time; each process needs a separate sampler.

    Parameters
    ----------
    sources : sequence of Source
    settings : PairSettings, optional
    seed : int
        The same seed gives the same pairs, in any process and any order.

    Raises
    ------
    ArgumentError
        No source has a weight above 0.
    """

    def __init__(
        self, sources: Sequence[Source], settings: PairSettings | None = None, seed: int = 0
    ) -> None:
        self._settings = settings or PairSettings()
        self._targets = TargetSampler(sources, self._settings.reach)
        self._seed = seed
        self._warned: set[str] = set()

    def batch(self, step: int, size: int) -> Batch:
        """The first `size` pairs of a step.

        Raises
        ------
        DatasetError
            A hundred draws found no visible target. The message names the last damaged file.
        """
        return collate([self.pair(step, index) for index in range(size)])

    def pair(self, step: int, index: int) -> Pair:
        """One pair of a step; raises as `batch`."""
        rng = np.random.default_rng([self._seed, step, index])
        rng_of_step = np.random.default_rng([self._seed, step])
        with_recent = bool(rng_of_step.random() < self._settings.recent)
        last_error = ""
        for _ in range(_TRIES):
            try:
                target = self._targets.draw(rng)
                if target is not None:
                    return self._pair(target, rng, with_recent)
            except SsiamError as error:
                last_error = str(error)
                self._warn_once(last_error)
        raise DatasetError(
            f"training data: {_TRIES} draws show no target; {last_error or 'all are hidden'}"
        )

    def _warn_once(self, message: str) -> None:
        if message not in self._warned:
            self._warned.add(message)
            _log.warning("%s; left out", message)

    def _pair(self, target: TargetFrame, rng: np.random.Generator, with_recent: bool) -> Pair:
        augment = self._settings.augment
        mirrored, gray = bool(rng.random() < augment.flip), rng.random() < augment.grey
        template = self._template(target, mirrored, rng)
        nearby = self._targets.draw_nearby(target, rng)
        sample = self._search_sample(nearby, mirrored, rng)
        search, box = self._cut(sample, rng)
        template, search = (augment_crop(crop, augment, rng) for crop in (template, search))
        recent = self._recent_template(nearby, mirrored, rng) if with_recent else None
        template_wh = _template_wh(target)
        if augment.small and rng.random() < augment.small:
            size = math.sqrt(math.prod(template_wh))
            factor = size / min(size, rng.uniform(*_SMALL))
            template, search = (coarsen(crop, factor) for crop in (template, search))
            recent = None if recent is None else coarsen(recent, factor)
        if gray:
            template, search = to_grayscale(template), to_grayscale(search)
            recent = None if recent is None else to_grayscale(recent)
        return Pair(template, search, box, sample.present, recent, template_wh)

    def _template(self, target: TargetFrame, mirrored: bool, rng: np.random.Generator) -> Image:
        region = random_template_region(target.xywh, mirrored, self._settings.windows, rng)
        shake = self._shake(target, self._settings.augment.shake * _TEMPLATE_SHAKE, rng)
        return motion_blur(crop_image(target.image, region), shake.trail, region.crop_from_frame)

    def _recent_template(
        self, target: TargetFrame, mirrored: bool, rng: np.random.Generator
    ) -> Image:
        """A crop of the target in a frame near the search crop's, or sometimes of a distractor."""
        windows = self._settings.windows
        varied = replace(
            windows,
            template_shift=windows.template_shift * _RECENT_VARIATION,
            template_scale=windows.template_scale * _RECENT_VARIATION,
        )
        recent = self._recent_frame(target, rng)
        region = random_template_region(recent.xywh, mirrored, varied, rng)
        return augment_crop(crop_image(recent.image, region), self._settings.augment, rng)

    def _recent_frame(self, target: TargetFrame, rng: np.random.Generator) -> TargetFrame:
        if rng.random() < self._settings.mistaken:
            distractor = self._targets.draw_distractor(target, rng)
            if distractor is not None:
                return distractor
        return self._targets.draw_nearby(target, rng, self._settings.reach // _RECENT_REACH)

    def _cut(
        self, sample: _SearchSample, rng: np.random.Generator
    ) -> tuple[Image, NDArray[np.float32]]:
        """The search crop, and the box (4,) of the target in it."""
        crop = crop_image(sample.frame.image, sample.region, sample.background)
        box = sample.box
        if box is None:
            box = np.zeros(4)
        elif rng.random() < self._settings.augment.cover:
            crop, _ = occlude(crop, box, rng)
        crop = motion_blur(crop, sample.shake.trail, sample.region.crop_from_frame)
        return crop, box.astype(np.float32)

    def _search_sample(
        self, target: TargetFrame, mirrored: bool, rng: np.random.Generator
    ) -> _SearchSample:
        """A search crop that shows the target, or a negative."""
        sample = None
        if rng.random() < self._settings.negatives:
            sample = self._negative(target, mirrored, rng)
        return sample or self._aimed_at(target, target, mirrored, rng)

    def _negative(
        self, target: TargetFrame, mirrored: bool, rng: np.random.Generator
    ) -> _SearchSample | None:
        """A search crop without the target; None if none was found."""
        kind, settings = rng.random(), self._settings
        if kind < settings.beside:
            distractor = self._targets.draw_distractor(target, rng)
            if distractor is not None:
                sample = self._aimed_at(distractor, target, mirrored, rng)
                if excludes(sample.region, target.xywh):
                    return sample
        elif kind < settings.beside + settings.away:
            size_wh = image_size(target.image)
            region = random_negative_region(target.xywh, size_wh, mirrored, settings.windows, rng)
            if region is not None:
                shake = self._shake(target, settings.augment.shake, rng)
                background = self._background(target, target, region, rng)
                return _SearchSample(target, region, shake, False, background)
        other = self._targets.draw_other(target, rng)
        return None if other is None else self._aimed_at(other, target, mirrored, rng)

    def _aimed_at(
        self, frame: TargetFrame, target: TargetFrame, mirrored: bool, rng: np.random.Generator
    ) -> _SearchSample:
        """A search crop around `frame`, which is the target or another object."""
        settings, present = self._settings, frame is target
        shake = self._shake(frame, settings.augment.shake, rng)
        any_angle = present and self._draw_any_angle(frame, rng)
        towards_xy = self._towards_distractor(frame, rng) if present and settings.towards else None
        region = random_search_region(
            frame.xywh,
            mirrored,
            shake.step_xy,
            settings.windows,
            rng,
            any_angle=any_angle,
            towards_xy=towards_xy,
        )
        background = self._background(target, frame, region, rng)
        return _SearchSample(frame, region, shake, present, background, any_angle)

    def _shake(self, frame: TargetFrame, probability: float, rng: np.random.Generator) -> Shake:
        """With `probability`, a camera shake at the object of a frame."""
        if rng.random() >= probability:
            return NO_SHAKE
        return draw_shake(center_of(frame.xywh), image_size(frame.image), rng)

    def _draw_any_angle(self, target: TargetFrame, rng: np.random.Generator) -> bool:
        """Whether to rotate by an arbitrary angle; only targets with a mask are rotated."""
        if rng.random() >= self._settings.windows.turned:
            return False
        mask = target.track.mask(target.t)
        return mask is not None and bool(mask.any())

    def _towards_distractor(
        self, target: TargetFrame, rng: np.random.Generator
    ) -> NDArray[np.float64] | None:
        """Sometimes, the vector (2,) to a distractor in the same frame, px of the frame."""
        if rng.random() >= self._settings.towards:
            return None
        distractor = self._targets.draw_distractor(target, rng)
        if distractor is None:
            return None
        return np.subtract(center_of(distractor.xywh), center_of(target.xywh))

    def _background(
        self, target: TargetFrame, frame: TargetFrame, region: CropRegion, rng: np.random.Generator
    ) -> Image | None:
        """Sometimes, a crop without the target for the part of a region outside its frame."""
        if rng.random() >= self._settings.surroundings or region.is_within(image_size(frame.image)):
            return None
        other = self._targets.draw_other(target, rng)
        if other is None:
            return None
        inside = random_background_region(image_size(other.image), rng)
        return crop_image(other.image, inside)


def _template_wh(target: TargetFrame) -> tuple[float, float]:
    """Width and height of the target in a template crop without variation, px."""
    zoom = TEMPLATE_CROP / region_around(target.xywh, TEMPLATE_CROP).side
    return target.xywh[2] * zoom, target.xywh[3] * zoom
