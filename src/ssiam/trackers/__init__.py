"""Trackers, and `StabilizedTracker`, which runs them on stabilized frames."""

from ssiam.trackers.base import ViewTracker
from ssiam.trackers.group import TrackerGroup
from ssiam.trackers.registry import (
    DEFAULT_TRACKER,
    TRACKERS,
    TrackerName,
    has_networks,
    load_tracker,
    recognizes_distractors,
    weights_path,
)
from ssiam.trackers.stabilized import StabilizedTracker

__all__ = [
    "DEFAULT_TRACKER",
    "TRACKERS",
    "StabilizedTracker",
    "TrackerGroup",
    "TrackerName",
    "ViewTracker",
    "has_networks",
    "load_tracker",
    "recognizes_distractors",
    "weights_path",
]
