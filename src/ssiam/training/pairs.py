"""`PairSampler`: pairs of a template and a search crop, each told by its seed, step and place."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import DatasetError
from ssiam.errors import SsiamError
from ssiam.geometry import Image
from ssiam.training.augment import changed, covered, greyed
from ssiam.training.batches import SEARCH, Batch, Pair, batch_of
from ssiam.training.choosing import Shot
from ssiam.training.crops import crop_mask, crop_picture, mask_cells
from ssiam.training.pair_settings import PairSettings
from ssiam.training.shaking import smeared
from ssiam.training.sources import Source
from ssiam.training.views import View, ViewChooser
from ssiam.training.windows import template_window

_log = logging.getLogger(__name__)

# Targets drawn for one pair before it is said that there are none.
_TRIES = 100
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
        last = ""
        for _ in range(_TRIES):
            try:
                shot = self._views.first(rng)
                if shot is not None:
                    return self._pair(shot, rng)
            except SsiamError as error:
                last = str(error)
                self._tell(last)
        raise DatasetError(f"training data: {_TRIES} draws show no target; {last or 'all hidden'}")

    def _tell(self, message: str) -> None:
        if message not in self._told:
            self._told.add(message)
            _log.warning("%s; left out", message)

    def _pair(self, shot: Shot, rng: np.random.Generator) -> Pair:
        augment = self._settings.augment
        mirrored, grey = bool(rng.random() < augment.flip), rng.random() < augment.grey
        template = self._template(shot, mirrored, rng)
        view = self._views.view(shot, mirrored, rng)
        search, box, mask = self._search(view, rng)
        template, search = (changed(crop, augment, rng) for crop in (template, search))
        if grey:
            template, search = greyed(template), greyed(search)
        return Pair(template, search, box, view.present, mask)

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
