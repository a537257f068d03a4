"""Track a chosen object in video from a shaking, moving camera.

The method is "Real-time Tracking with Stabilized Frame" (S-Siam, 2020): estimate the camera's
motion, stabilize the frame, run an unchanged tracker on the stabilized view, map the result back.

    tracker = ssiam.load_tracker()
    tracker.init(frame, (x, y, w, h))
    track = tracker.update(next_frame)
"""

from ssiam.errors import (
    ArgumentError,
    CopyError,
    FrameSizeError,
    MissingExtraError,
    SinkError,
    SourceError,
    SsiamError,
    StreamError,
    WeightsError,
)
from ssiam.motion import CameraMotion, Motion
from ssiam.stabilize import FrameView, Stabilizer, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import TRACKERS, StabilizedTracker, TrackerGroup, load_tracker

__all__ = [
    "TRACKERS",
    "ArgumentError",
    "CameraMotion",
    "CopyError",
    "FrameSizeError",
    "FrameView",
    "MissingExtraError",
    "Motion",
    "SinkError",
    "SourceError",
    "SsiamError",
    "StabilizedTracker",
    "Stabilizer",
    "StabilizerConfig",
    "StreamError",
    "Track",
    "TrackerGroup",
    "WeightsError",
    "load_tracker",
]
