"""`TargetSampler`: random targets, other frames of a target, distractors and other targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ssiam.errors import ArgumentError
from ssiam.geometry import XYWH, Image
from ssiam.training.data.images import image_size
from ssiam.training.data.tracks import Source, TrainingTrack

__all__ = ["TargetFrame", "TargetSampler"]

_TRIES: Final = 6  # frames or tracks that are tried before giving up
# Requirements on targets.
_MIN_SIDE: Final = 10.0  # px, square root of the area
_MIN_INSIDE: Final = 0.5  # fraction of the box inside the frame
_MAX_ASPECT: Final = 12.0


@dataclass(frozen=True, eq=False)
class TargetFrame:
    """A target in one frame.

    Attributes
    ----------
    source, index : int
        Index of the source among the sources, and of the track in the source.
    track : TrainingTrack
    t : int
        The frame.
    xywh : (float, float, float, float)
        The target's box in the frame.
    image : (H, W, 3) uint8 BGR
    """

    source: int
    index: int
    track: TrainingTrack
    t: int
    xywh: XYWH
    image: Image


class TargetSampler:
    """Samples targets: a source by weight, then a track and a frame uniformly.

    Parameters
    ----------
    sources : sequence of Source
    reach : int
        Largest distance between the two frames of a pair, frames.

    Raises
    ------
    ArgumentError
        No source has a weight above 0.
    """

    def __init__(self, sources: Sequence[Source], reach: int) -> None:
        weights = np.array([source.weight for source in sources], dtype=np.float64)
        if not weights.sum() > 0:
            raise ArgumentError("no set of training data has a weight above 0; give one a weight")
        self._sources = sources
        self._probabilities = weights / weights.sum()
        self._reach = reach

    def draw(self, rng: np.random.Generator) -> TargetFrame | None:
        """A random target; None if the drawn track has no usable frame among those tried."""
        source = int(rng.choice(len(self._sources), p=self._probabilities))
        index = int(rng.integers(len(self._sources[source])))
        track = self._sources[source].track(index)
        frames = rng.integers(track.frames, size=_TRIES if track.frames > 1 else 1)
        found = (_usable_frame(source, index, track, int(t)) for t in frames)
        return next(filter(None, found), None)

    def draw_nearby(
        self, target: TargetFrame, rng: np.random.Generator, reach: int | None = None
    ) -> TargetFrame:
        """The same target in a frame within reach, before or after; possibly the same frame.

        Parameters
        ----------
        target : TargetFrame
        rng : Generator
        reach : int, optional
            Frames; None for the sampler's.
        """
        reach = self._reach if reach is None else reach
        last = target.track.frames - 1
        low, high = max(0, target.t - reach), min(last, target.t + reach)
        frames = rng.integers(low, high + 1, size=_TRIES if last else 0)
        found = (_usable_frame(target.source, target.index, target.track, int(t)) for t in frames)
        return next(filter(None, found), target)

    def draw_other(self, target: TargetFrame, rng: np.random.Generator) -> TargetFrame | None:
        """A target whose frame cannot show `target`; None if none was drawn."""
        for _ in range(_TRIES):
            other = self.draw(rng)
            if other is not None and self._shows_other(target, other):
                return other
        return None

    def draw_distractor(self, target: TargetFrame, rng: np.random.Generator) -> TargetFrame | None:
        """Another object in the same frame; None if there is none, or it is not usable."""
        source = self._sources[target.source]
        distractors = source.distractors(target.index)
        if not distractors:
            return None
        index = distractors[int(rng.integers(len(distractors)))]
        return _usable_frame(target.source, index, source.track(index), target.t)

    def _shows_other(self, target: TargetFrame, other: TargetFrame) -> bool:
        alike = target.source == other.source and self._sources[target.source].alike
        return not alike and not set(target.track.scene_ids) & set(other.track.scene_ids)


def _usable_frame(source: int, index: int, track: TrainingTrack, t: int) -> TargetFrame | None:
    """The target in a frame; None if it is hidden, too small or thin, or mostly outside."""
    xywh = track.box(t)
    if xywh is None or min(xywh[2:]) <= 0:
        return None
    x, y, w, h = xywh
    if w * h < _MIN_SIDE**2 or max(w / h, h / w) > _MAX_ASPECT:
        return None
    image = track.image(t)
    width, height = image_size(image)
    across, down = min(x + w, width) - max(x, 0), min(y + h, height) - max(y, 0)
    if across <= 0 or down <= 0 or across * down < _MIN_INSIDE * w * h:
        return None
    return TargetFrame(source, index, track, t, xywh, image)
