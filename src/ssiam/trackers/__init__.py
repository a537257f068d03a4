"""Trackers, and `StabilizedTracker`, which runs them on stabilized frames."""

from ssiam.trackers.base import ViewTracker
from ssiam.trackers.group import TrackerGroup
from ssiam.trackers.registry import DEFAULT_TRACKER, TRACKERS, TrackerName, load_tracker
from ssiam.trackers.stabilized import StabilizedTracker

__all__ = [
    "DEFAULT_TRACKER",
    "TRACKERS",
    "StabilizedTracker",
    "TrackerGroup",
    "TrackerName",
    "ViewTracker",
    "load_tracker",
]
