"""Keep hold of a chosen object in video from a shaking, moving camera."""

from ssiam.motion import Motion
from ssiam.trackers import Track

__all__ = ["Motion", "Track"]
