"""The trackers, and the steadied one that carries them."""

from ssiam.trackers.base import ViewTracker
from ssiam.trackers.catalogue import DEFAULT_TRACKER, TRACKERS, TrackerName, load_tracker
from ssiam.trackers.group import TrackerGroup
from ssiam.trackers.steadied import SteadiedTracker

__all__ = [
    "DEFAULT_TRACKER",
    "TRACKERS",
    "SteadiedTracker",
    "TrackerGroup",
    "TrackerName",
    "ViewTracker",
    "load_tracker",
]
