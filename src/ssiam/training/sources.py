"""`Source`: many tracks of objects, each a target in one or more pictures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image

Mask = NDArray[np.bool_]


class TrainingTrack(Protocol):
    """One object through the pictures of a video, or in a single picture.

    Threads: any number may read it at once.

    Frames count from 0. Boxes are pixels of the picture, 0-based: x is the first column that the
    target covers, w the number of columns.
    """

    @property
    def frames(self) -> int:
        """Number of pictures, at least 1."""

    @property
    def shows(self) -> tuple[str, ...]:
        """Paths of what its pictures are made of: tracks that share one may show the same."""

    def image(self, t: int) -> Image:
        """Picture (H, W, 3) uint8 BGR, not to be written to; `SsiamError` if it is broken."""

    def box(self, t: int) -> XYWH | None:
        """Box x, y, w, h of the target; None where it is hidden or not told."""

    def mask(self, t: int) -> Mask | None:
        """Mask (H, W) bool of the target; None where there is none."""


class Source(Protocol):
    """A set of tracks that training draws from.

    Threads: one thread at a time.
    """

    @property
    def name(self) -> str:
        """Its name in messages."""

    @property
    def weight(self) -> float:
        """Share of the pairs that it gives, relative to the other sources."""

    @property
    def alike(self) -> bool:
        """Whether any two tracks may show the very same object, as cuts of one video do."""

    def __len__(self) -> int:
        """Number of tracks."""

    def track(self, i: int) -> TrainingTrack:
        """The track of an index; the same one whenever it is asked for."""

    def beside(self, i: int) -> Sequence[int]:
        """Indices of the other tracks in the same pictures, frame by frame."""


@dataclass(frozen=True)
class Names:
    """Which videos or pictures of a set are taken: patterns as in a shell (``*``, ``?``, ``[ab]``).

    Attributes
    ----------
    only : tuple of str
        Names that are taken; empty: all.
    without : tuple of str
        Names that are left out of them.
    """

    only: tuple[str, ...] = ()
    without: tuple[str, ...] = ()

    def __contains__(self, name: str) -> bool:
        wanted = not self.only or any(fnmatchcase(name, pattern) for pattern in self.only)
        return wanted and not any(fnmatchcase(name, pattern) for pattern in self.without)


@dataclass(frozen=True, eq=False)
class TrackList:
    """A `Source` of tracks that are all known from the start.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    name : str
    tracks : sequence of TrainingTrack
    weight : float
    alike : bool
    """

    name: str
    tracks: Sequence[TrainingTrack]
    weight: float = 1.0
    alike: bool = False
    _shared: dict[tuple[str, ...], tuple[int, ...]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_shared", _together(self.tracks))

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.tracks)

    def track(self, i: int) -> TrainingTrack:
        """The track of an index."""
        return self.tracks[i]

    def beside(self, i: int) -> Sequence[int]:
        """Indices of the other tracks in the same pictures, frame by frame."""
        return [j for j in self._shared.get(self.tracks[i].shows, ()) if j != i]


def _together(tracks: Sequence[TrainingTrack]) -> dict[tuple[str, ...], tuple[int, ...]]:
    """Indices of tracks in the same pictures, where there are several."""
    indices: defaultdict[tuple[str, ...], list[int]] = defaultdict(list)
    for i, track in enumerate(tracks):
        indices[track.shows].append(i)
    return {shows: tuple(found) for shows, found in indices.items() if len(found) > 1}
