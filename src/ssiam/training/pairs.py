"""`PairSampler`: pairs of a template and a search crop, each told by its seed, step and place."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import DatasetError
from ssiam.errors import SsiamError
from ssiam.geometry import Image
from ssiam.training.augment import changed, coarsened, covered, greyed
from ssiam.training.batches import SEARCH, TEMPLATE, Batch, Pair, batch_of
from ssiam.training.choosing import Shot
from ssiam.training.crops import crop_mask, crop_picture, mask_cells, window_around
from ssiam.training.pair_settings import PairSettings
from ssiam.training.shaking import smeared
from ssiam.training.sources import Source
from ssiam.training.views import View, ViewChooser
from ssiam.training.windows import template_window

_log = logging.getLogger(__name__)

# Targets drawn for one pair before it is said that there are none.
_TRIES = 100
# By how much a tracker's boxes are less exact than annotated ones.
_LOOSE = 2.5
# Pixels of the frame: sides of a small target.
_SMALL = (12.0, 32.0)
# How often the template is smeared, against the search crop.
_TEMPLATE_SHAKE = 0.25


class PairSampler:
    """Draws pairs of crops from sources; pictures that cannot be read are told once and passed.

    Threads: one thread at a time; other processes make one of their own.

    Parameters
    ----------
    sources : sequence of Source
    settings : PairSettings
    seed : int
        The same seed gives the same pairs, whoever draws them and in whatever order.

    Raises
    ------
    ArgumentError
        No source has a weight.
    """

    def __init__(
        self, sources: Sequence[Source], settings: PairSettings | None = None, seed: int = 0
    ) -> None:
        self._settings = settings or PairSettings()
        self._views = ViewChooser(sources, self._settings)
        self._seed = seed
        self._told: set[str] = set()

    def batch(self, step: int, size: int) -> Batch:
        """The pairs of a step: the first `size` of it.

        Raises
        ------
        DatasetError
            The sources show no target in a hundred draws; names the last broken file, if any.
        """
        return batch_of([self.pair(step, place) for place in range(size)])

    def pair(self, step: int, place: int) -> Pair:
        """One pair of a step; raises as `batch`."""
        rng = np.random.default_rng([self._seed, step, place])
        of_step = np.random.default_rng([self._seed, step])
        recent = bool(of_step.random() < self._settings.recent)
        last = ""
        for _ in range(_TRIES):
            try:
                shot = self._views.first(rng)
                if shot is not None:
                    return self._pair(shot, rng, recent)
            except SsiamError as error:
                last = str(error)
                self._tell(last)
        raise DatasetError(f"training data: {_TRIES} draws show no target; {last or 'all hidden'}")

    def _tell(self, message: str) -> None:
        if message not in self._told:
            self._told.add(message)
            _log.warning("%s; left out", message)

    def _pair(self, shot: Shot, rng: np.random.Generator, with_recent: bool) -> Pair:
        augment = self._settings.augment
        mirrored, grey = bool(rng.random() < augment.flip), rng.random() < augment.grey
        template = self._template(shot, mirrored, rng)
        view = self._views.view(shot, mirrored, rng)
        search, box, mask = self._search(view, rng)
        template, search = (changed(crop, augment, rng) for crop in (template, search))
        recent = self._recent(view, mirrored, rng) if with_recent else None
        if augment.small and rng.random() < augment.small:
            size = _target_side(shot)
            factor = size / min(size, rng.uniform(*_SMALL))
            template, search = (coarsened(crop, factor) for crop in (template, search))
            recent = None if recent is None else coarsened(recent, factor)
        if grey:
            template, search = greyed(template), greyed(search)
            recent = None if recent is None else greyed(recent)
        size_wh = _template_wh(shot)
        return Pair(template, search, box, view.present, mask, recent, size_wh)

    def _recent(self, view: View, mirrored: bool, rng: np.random.Generator) -> Image | None:
        """The target near the view's time, cut less exactly than the template."""
        if view.target is None:
            return None
        windows = self._settings.windows
        loose = replace(
            windows,
            template_shift=windows.template_shift * _LOOSE,
            template_scale=windows.template_scale * _LOOSE,
        )
        shot = self._views.recent(view.target, rng)
        crop = crop_picture(shot.image, template_window(shot.xywh, mirrored, loose, rng))
        return changed(crop, self._settings.augment, rng)

    def _template(self, shot: Shot, mirrored: bool, rng: np.random.Generator) -> Image:
        window = template_window(shot.xywh, mirrored, self._settings.windows, rng)
        shake = self._views.shake(shot, self._settings.augment.shake * _TEMPLATE_SHAKE, rng)
        return smeared(crop_picture(shot.image, window), shake.trail, window.crop_from_frame)

    def _search(
        self, view: View, rng: np.random.Generator
    ) -> tuple[Image, NDArray[np.float32], NDArray[np.uint8] | None]:
        """The search crop, with the box (4,) and the mask (64, 64) of what is to be found."""
        crop = crop_picture(view.shot.image, view.window, view.behind)
        box, coverage = view.box, np.zeros((SEARCH, SEARCH), dtype=np.uint8)
        mask = view.mask
        if mask is not None:
            coverage = crop_mask(mask, view.window)
        if box is None:
            box = np.zeros(4)
        elif rng.random() < self._settings.augment.cover:
            crop, hidden = covered(crop, box, rng)
            coverage[hidden] = 0
        crop = smeared(crop, view.shake.trail, view.window.crop_from_frame)
        told = mask is not None or not view.present
        return crop, box.astype(np.float32), mask_cells(coverage) if told else None


def _target_side(shot: Shot) -> float:
    """The side of a square of the target's area, pixels of the template crop."""
    return math.sqrt(math.prod(_template_wh(shot)))


def _template_wh(shot: Shot) -> tuple[float, float]:
    """Width and height of the target in a template crop that is cut exactly, pixels."""
    zoom = TEMPLATE / window_around(shot.xywh, TEMPLATE).side
    return shot.xywh[2] * zoom, shot.xywh[3] * zoom
