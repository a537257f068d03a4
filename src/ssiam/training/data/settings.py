"""Settings of sampling and augmentation: the tables [pairs], [pairs.windows], [pairs.augment]."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Final

from ssiam.errors import ArgumentError

__all__ = ["MAX_OFFSET", "AugmentSettings", "CropSettings", "PairSettings"]

# Largest offset of a target's center from the middle of the search crop, px. The response maps
# reach 124 px; a target at the limit is still partly visible.
MAX_OFFSET: Final = 112.0


@dataclass(frozen=True)
class CropSettings:
    """How far template and search regions deviate from the true box.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    shift : float
        Largest offset of the target in x and in y, px of the search crop; uniformly distributed.
    far : float
        Fraction 0..1 of search regions with offsets up to 112 px and twice the scale deviation.
    scale : float
        Standard deviation of the log of the search region's size.
    stretch : float
        Standard deviation of the log of the aspect ratio, of both regions.
    angle : float
        Standard deviation of the rotation of both regions, degrees.
    turned : float
        Fraction 0..1 of search regions that are rotated by an arbitrary angle. Only targets with
        a mask are rotated: the box around a rotated target cannot be computed from a box alone.
    template_shift : float
        Largest offset of the template region, px of the template crop. Models inexact annotation.
    template_scale : float
        Standard deviation of the log of the template region's size.

    Raises
    ------
    ArgumentError
        A fraction is outside 0..1, or `shift` exceeds 112 px.
    """

    shift: float = 64.0
    far: float = 0.1
    scale: float = 0.15
    stretch: float = 0.05
    angle: float = 2.0
    turned: float = 0.0
    template_shift: float = 3.0
    template_scale: float = 0.04

    def __post_init__(self) -> None:
        if not 0 <= self.shift <= MAX_OFFSET:
            raise ArgumentError(f"shift {self.shift} of windows: give 0 to {MAX_OFFSET} pixels")
        _check_fractions(self, ("far", "turned"), "windows")


@dataclass(frozen=True)
class AugmentSettings:
    """Probabilities 0..1 of the augmentations.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    grey : float
        Both crops in grayscale.
    flip : float
        Both crops mirrored.
    colour : float
        Each crop with other brightness, contrast, color cast, saturation and hue.
    blur : float
        Each crop defocused.
    shake : float
        The search region shifted and its crop blurred by a simulated camera shake. The template
        is blurred in the same way with a quarter of this probability.
    jpeg : float
        Each crop with compression artifacts.
    cover : float
        A part of the target occluded.
    small : float
        Both crops at the resolution of a target of 12 to 32 px.

    Raises
    ------
    ArgumentError
        A probability is outside 0..1.
    """

    grey: float = 0.08
    flip: float = 0.5
    colour: float = 0.7
    blur: float = 0.1
    shake: float = 0.35
    jpeg: float = 0.2
    cover: float = 0.12
    small: float = 0.0

    def __post_init__(self) -> None:
        _check_fractions(self, tuple(each.name for each in fields(self)), "augment")


@dataclass(frozen=True)
class PairSettings:
    """How pairs of a template and a search crop are sampled.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    reach : int
        Largest distance between the frames of template and search crop, frames.
    negatives : float
        Fraction 0..1 of pairs whose search crop does not show the target.
    beside, away : float
        Fractions 0..1 of the negatives: `beside` of them show a distractor in the same frame, if
        there is one, and `away` another part of the frame. The others show the target of another
        track.
    recent : float
        Fraction 0..1 of batches with a second, recent template. In the other batches the template
        is also the recent one, which is faster.
    mistaken : float
        Fraction 0..1 of the recent templates that show a distractor.
    towards : float
        Fraction 0..1 of search crops that are shifted towards a distractor in the same frame.
    surroundings : float
        Fraction 0..1 of search crops that are filled with another track's image beyond the frame
        border; the others are filled with the mean color.
    windows : CropSettings
    augment : AugmentSettings

    Raises
    ------
    ArgumentError
        A fraction is outside 0..1, or `reach` is negative.
    """

    reach: int = 100
    negatives: float = 0.12
    beside: float = 0.4
    away: float = 0.2
    recent: float = 0.0
    mistaken: float = 0.05
    towards: float = 0.0
    surroundings: float = 0.5
    windows: CropSettings = field(default_factory=CropSettings)
    augment: AugmentSettings = field(default_factory=AugmentSettings)

    def __post_init__(self) -> None:
        names = "negatives", "beside", "away", "recent", "mistaken", "towards", "surroundings"
        _check_fractions(self, names, "pairs")
        if self.beside + self.away > 1:
            raise ArgumentError(
                f"beside {self.beside} and away {self.away} of pairs: give fractions whose sum "
                "is at most 1"
            )
        if self.reach < 0:
            raise ArgumentError(f"reach {self.reach} of pairs: give 0 or more frames")


def _check_fractions(
    settings: CropSettings | AugmentSettings | PairSettings, names: tuple[str, ...], table: str
) -> None:
    for name in names:
        value = getattr(settings, name)
        if not 0 <= value <= 1:
            raise ArgumentError(f"{name} {value} of {table}: give a fraction from 0 to 1")
