"""`StoredTrack`, `TrackRecords`: tracks that are kept for a whole clip, in little memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import mask_bounds
from ssiam.motion import Motion
from ssiam.track import Track


@dataclass(frozen=True)
class StoredTrack:
    """A track whose mask is packed."""

    plain: Track
    shape: tuple[int, int] = (0, 0)  # height and width of the mask
    bounds: tuple[slice, slice] = (slice(0, 0), slice(0, 0))  # rows and columns around it
    bits: NDArray[np.uint8] | None = None

    @classmethod
    def of(cls, track: Track) -> StoredTrack:
        """Store a track."""
        mask = track.mask
        if mask is None:
            return cls(track)
        bounds, shape = mask_bounds(mask), (mask.shape[0], mask.shape[1])
        return cls(replace(track, mask=None), shape, bounds, np.packbits(mask[bounds]))

    def track(self) -> Track:
        """The track, with its mask."""
        if self.bits is None:
            return self.plain
        mask = np.zeros(self.shape, dtype=np.bool_)
        part = mask[self.bounds]
        part[:] = np.unpackbits(self.bits, count=part.size).reshape(part.shape)
        return replace(self.plain, mask=mask)


class TrackRecords:
    """The tracks of all frames; masks take a bit for each pixel of their bounds.

    Parameters
    ----------
    targets : int
    has_outlines : bool
        Whether masks and rotated boxes are kept. They are not computed otherwise.
    """

    def __init__(self, targets: int, *, has_outlines: bool = True) -> None:
        self._targets = targets
        self._has_outlines = has_outlines
        self._stored: dict[int, list[StoredTrack | None]] = {}

    def __len__(self) -> int:
        return len(self._stored)

    def add(self, frame_index: int, tracks: Sequence[Track | None]) -> None:
        """Store the tracks of a frame; None for targets that have not begun."""
        self._stored[frame_index] = [
            None if track is None else self._stored_track(track) for track in tracks
        ]

    def _stored_track(self, track: Track) -> StoredTrack:
        if not self._has_outlines:
            return StoredTrack(track.with_changes(corners=None, mask=None))
        return StoredTrack.of(track)

    def tracks(self, frame_index: int) -> list[Track | None]:
        """The tracks of a frame; all None for a frame that was not added."""
        stored = self._stored.get(frame_index, [None] * self._targets)
        return [None if each is None else each.track() for each in stored]


def inverse_motion(motion: Motion | None) -> Motion | None:
    """The motion to the later frame from that to the earlier one."""
    if motion is None:
        return None
    prev_from_cur = np.linalg.inv(motion.cur_from_prev).astype(np.float64)
    return replace(motion, cur_from_prev=prev_from_cur)
