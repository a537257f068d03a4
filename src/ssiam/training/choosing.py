"""`Chooser`: which target of which source, in which two pictures of its track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, Image
from ssiam.training.pictures import size_of
from ssiam.training.sources import Source, TrainingTrack

# Frames tried in which the target might be to be seen.
_TRIES = 6
# Targets: the least side and share of the box inside of the picture, the greatest aspect.
_SMALLEST = 10.0
_INSIDE = 0.5
_SLIMMEST = 12.0


@dataclass(frozen=True, eq=False)
class Shot:
    """A target in one picture.

    Attributes
    ----------
    source, index : int
        Of the source among the sources, and of the track in it.
    track : TrainingTrack
    t : int
        The frame.
    xywh : (float, float, float, float)
        Where the target is in it.
    image : (H, W, 3) uint8 BGR
    """

    source: int
    index: int
    track: TrainingTrack
    t: int
    xywh: XYWH
    image: Image


class Chooser:
    """Draws targets: a source by its weight, any of its tracks, any frame that shows the target.

    Parameters
    ----------
    sources : sequence of Source
    reach : int
        Frames between the two of a pair, at most.

    Raises
    ------
    ArgumentError
        No source has a weight.
    """

    def __init__(self, sources: Sequence[Source], reach: int) -> None:
        weights = np.array([source.weight for source in sources], dtype=np.float64)
        if not weights.sum() > 0:
            raise ArgumentError("no set of training data has a weight above 0")
        self._sources = sources
        self._chances = weights / weights.sum()
        self._reach = reach

    def first(self, rng: np.random.Generator) -> Shot | None:
        """Any target; None if the track drawn shows it in none of the frames tried."""
        source = int(rng.choice(len(self._sources), p=self._chances))
        index = int(rng.integers(len(self._sources[source])))
        track = self._sources[source].track(index)
        frames = rng.integers(track.frames, size=_TRIES if track.frames > 1 else 1)
        return next(filter(None, (_shot(source, index, track, int(t)) for t in frames)), None)

    def later(self, shot: Shot, rng: np.random.Generator, reach: int | None = None) -> Shot:
        """The same target in another picture within reach, before or after; or in the same.

        `reach` is that of the chooser unless it is given, frames.
        """
        reach = self._reach if reach is None else reach
        last = shot.track.frames - 1
        near, far = max(0, shot.t - reach), min(last, shot.t + reach)
        frames = rng.integers(near, far + 1, size=_TRIES if last else 0)
        found = (_shot(shot.source, shot.index, shot.track, int(t)) for t in frames)
        return next(filter(None, found), shot)

    def another(self, shot: Shot, rng: np.random.Generator) -> Shot | None:
        """A target whose picture cannot show that of `shot`; None if none was drawn."""
        for _ in range(_TRIES):
            other = self.first(rng)
            if other is not None and self._is_another(shot, other):
                return other
        return None

    def beside(self, shot: Shot, rng: np.random.Generator) -> Shot | None:
        """Another target in the same picture; None if there is none to be seen."""
        source = self._sources[shot.source]
        rivals = source.beside(shot.index)
        if not rivals:
            return None
        index = rivals[int(rng.integers(len(rivals)))]
        return _shot(shot.source, index, source.track(index), shot.t)

    def _is_another(self, shot: Shot, other: Shot) -> bool:
        alike = shot.source == other.source and self._sources[shot.source].alike
        return not alike and not set(shot.track.shows) & set(other.track.shows)


def _shot(source: int, index: int, track: TrainingTrack, t: int) -> Shot | None:
    """The target in a frame; None if it is hidden, tiny, a line, or hardly in the picture."""
    xywh = track.box(t)
    if xywh is None or min(xywh[2:]) <= 0:
        return None
    x, y, w, h = xywh
    if w * h < _SMALLEST**2 or max(w / h, h / w) > _SLIMMEST:
        return None
    image = track.image(t)
    width, height = size_of(image)
    across, down = min(x + w, width) - max(x, 0), min(y + h, height) - max(y, 0)
    if across <= 0 or down <= 0 or across * down < _INSIDE * w * h:
        return None
    return Shot(source, index, track, t, xywh, image)
