"""`to_detections`: tracks as detections of Roboflow's supervision."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ssiam.errors import ArgumentError, MissingExtraError
from ssiam.geometry import Points, corners_from_xywh
from ssiam.track import Track

if TYPE_CHECKING:
    import supervision

# Key that supervision's annotators of oriented boxes use.
_ORIENTED = "xyxyxyxy"


def to_detections(
    tracks: Sequence[Track], ids: Sequence[int] | None = None
) -> supervision.Detections:
    """Convert the tracks that are not lost, for supervision's annotators, zones and counters.

    Parameters
    ----------
    tracks : sequence of Track
        The tracks of one frame.
    ids : sequence of int, optional
        Number of each target; 1, 2, ... by default.

    Returns
    -------
    supervision.Detections
        N detections in raw-frame pixels: `xyxy` (N, 4) float32, `confidence` (N,) float32,
        `tracker_id` (N,) int, ``data["corners"]`` (N, 4, 2) float32; with a mask tracker also
        `mask` (N, H, W) bool, and with rotated boxes ``data["xyxyxyxy"]``, supervision's name for
        them. `class_id` is not set: use ``ColorLookup.TRACK`` for colors.

    Raises
    ------
    MissingExtraError
        supervision is not installed.
    ArgumentError
        The number of `ids` differs from that of `tracks`.
    """
    try:
        import supervision
    except ImportError as error:
        raise MissingExtraError(
            f"detections need supervision ({error}): pip install supervision"
        ) from error
    return supervision.Detections(**detection_fields(tracks, ids))


def detection_fields(tracks: Sequence[Track], ids: Sequence[int] | None = None) -> dict[str, Any]:
    """The arrays that `to_detections` passes to supervision, by field name."""
    if ids is not None and len(ids) != len(tracks):
        raise ArgumentError(f"{len(ids)} ids for {len(tracks)} tracks: give one id per track")
    numbers = range(1, len(tracks) + 1) if ids is None else ids
    by_number = {n: track for n, track in zip(numbers, tracks, strict=True) if has_box(track)}
    visible = by_number.values()
    boxes = np.array([track.box for track in visible], dtype=np.float32).reshape(-1, 4)
    corners = np.array([_corners(track) for track in visible], dtype=np.float32).reshape(-1, 4, 2)
    masks = [track.mask for track in visible if track.mask is not None]
    data = {"corners": corners}
    if any(track.corners is not None for track in visible):
        data[_ORIENTED] = corners
    return {
        "xyxy": np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]),
        "mask": np.stack(masks) if masks and len(masks) == len(visible) else None,
        "confidence": np.array([track.score for track in visible], dtype=np.float32),
        "tracker_id": np.array(list(by_number), dtype=np.int64),
        "data": data,
    }


def has_box(track: Track) -> bool:
    """Whether the track has a box to display: it is not lost, and its box is finite."""
    return not track.lost and bool(np.isfinite(track.box).all())


def _corners(track: Track) -> Points:
    return corners_from_xywh(track.box) if track.corners is None else track.corners
