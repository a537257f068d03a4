"""`View`: what the search crop is cut from; with the target, or without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.training.choosing import Chooser, Shot
from ssiam.training.crops import Window, centre_of, crop_picture
from ssiam.training.pair_settings import PairSettings
from ssiam.training.pictures import size_of
from ssiam.training.shaking import STILL, Shake, draw_shake
from ssiam.training.sources import Mask, Source
from ssiam.training.windows import is_clear, search_window, window_away, window_inside

# The reach of pairs, for each frame that a recent template is apart.
_RECENT: Final = 4


@dataclass(frozen=True, eq=False)
class View:
    """A search crop before it is cut.

    Attributes
    ----------
    shot : Shot
        The picture.
    window : Window
    shake : Shake
    present : bool
        Whether the target is that of `shot`; else it is not to be seen.
    behind : (255, 255, 3) uint8, optional
        What is seen beyond the picture.
    turned : bool
        Whether the window is rolled by any angle; the target then has a mask.
    target : Shot, optional
        The target near that time, whether the crop shows it or not.
    """

    shot: Shot
    window: Window
    shake: Shake
    present: bool
    behind: Image | None = None
    turned: bool = False
    target: Shot | None = None

    @property
    def box(self) -> NDArray[np.float64] | None:
        """The target's box (4,) in the crop: centre from its middle pixel, width, height."""
        if not self.present:
            return None
        mask = self.mask if self.turned else None
        return self.window.seen(self.shot.xywh) if mask is None else self.window.seen_of(mask)

    @cached_property
    def mask(self) -> Mask | None:
        """The target's mask in the picture."""
        return self.shot.track.mask(self.shot.t) if self.present else None


class ViewChooser:
    """Draws targets and views.

    Parameters
    ----------
    sources : sequence of Source
    settings : PairSettings
    """

    def __init__(self, sources: Sequence[Source], settings: PairSettings) -> None:
        self._chooser = Chooser(sources, settings.reach)
        self._settings = settings

    def first(self, rng: np.random.Generator) -> Shot | None:
        """A target for a template; None if the track drawn does not show it."""
        return self._chooser.first(rng)

    def view(self, shot: Shot, mirrored: bool, rng: np.random.Generator) -> View:
        """A view in which the target of `shot` is to be found, or known not to be."""
        later = self._chooser.later(shot, rng)
        view = None
        if rng.random() < self._settings.negatives:
            view = self._negative(later, mirrored, rng)
        return replace(view or self._aimed(later, later, mirrored, rng), target=later)

    def recent(self, target: Shot, rng: np.random.Generator) -> Shot:
        """The target of a view as it was lately or, now and then, a distractor beside it."""
        if rng.random() < self._settings.mistaken:
            distractor = self._chooser.beside(target, rng)
            if distractor is not None:
                return distractor
        return self._chooser.later(target, rng, self._settings.reach // _RECENT)

    def shake(self, shot: Shot, chance: float, rng: np.random.Generator) -> Shake:
        """A shake of the camera at the target of `shot`; none at all but by `chance`."""
        if rng.random() >= chance:
            return STILL
        return draw_shake(centre_of(shot.xywh), size_of(shot.image), rng)

    def _negative(self, shot: Shot, mirrored: bool, rng: np.random.Generator) -> View | None:
        """A view without the target of `shot`; None if there is none."""
        kind, settings = rng.random(), self._settings
        if kind < settings.beside:
            rival = self._chooser.beside(shot, rng)
            view = None if rival is None else self._aimed(shot, rival, mirrored, rng)
            if view is not None and is_clear(view.window, shot.xywh):
                return view
        elif kind < settings.beside + settings.away:
            away = window_away(shot.xywh, size_of(shot.image), mirrored, settings.windows, rng)
            if away is not None:
                shake = self.shake(shot, settings.augment.shake, rng)
                return View(shot, away, shake, False, self._behind(shot, shot, away, rng))
        other = self._chooser.another(shot, rng)
        return None if other is None else self._aimed(shot, other, mirrored, rng)

    def _aimed(self, target: Shot, shot: Shot, mirrored: bool, rng: np.random.Generator) -> View:
        """A view of `shot`, which may or may not be the target itself."""
        settings = self._settings
        shake = self.shake(shot, settings.augment.shake, rng)
        turned = shot is target and self._is_turned(shot, rng)
        towards_xy = self._towards(shot, rng) if shot is target and settings.towards else None
        window = search_window(
            shot.xywh,
            mirrored,
            shake.step_xy,
            settings.windows,
            rng,
            turned=turned,
            towards_xy=towards_xy,
        )
        behind = self._behind(target, shot, window, rng)
        return View(shot, window, shake, shot is target, behind, turned)

    def _towards(self, target: Shot, rng: np.random.Generator) -> NDArray[np.float64] | None:
        """By chance, the way (2,) to a distractor in the same picture, pixels of the picture."""
        if rng.random() >= self._settings.towards:
            return None
        distractor = self._chooser.beside(target, rng)
        if distractor is None:
            return None
        return np.subtract(centre_of(distractor.xywh), centre_of(target.xywh))

    def _is_turned(self, shot: Shot, rng: np.random.Generator) -> bool:
        """By chance, of a target whose mask tells its box from any side."""
        if rng.random() >= self._settings.windows.turned:
            return False
        mask = shot.track.mask(shot.t)
        return mask is not None and bool(mask.any())

    def _behind(
        self, target: Shot, shot: Shot, window: Window, rng: np.random.Generator
    ) -> Image | None:
        """A crop that does not show the target, by chance, if the picture leaves any room."""
        if rng.random() >= self._settings.surroundings or window.is_within(size_of(shot.image)):
            return None
        other = self._chooser.another(target, rng)
        if other is None:
            return None
        return crop_picture(other.image, window_inside(size_of(other.image), rng))
