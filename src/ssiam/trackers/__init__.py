"""Trackers, and `StabilizedTracker`, which runs them on stabilized frames."""

from ssiam.trackers.base import ViewTracker
from ssiam.trackers.group import TrackerGroup
from ssiam.trackers.registry import (
    DEFAULT_TRACKER,
    TRACKERS,
    TrackerName,
    check_tracker_name,
    has_networks,
    is_named_class,
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
    "check_tracker_name",
    "has_networks",
    "is_named_class",
    "load_tracker",
    "recognizes_distractors",
    "weights_path",
]
