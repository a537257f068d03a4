"""Track a chosen object in video from a shaking, moving camera.

The method is "Real-time Tracking with Stabilized Frame" (S-Siam, 2020): estimate the camera
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
from ssiam.stabilize import FrameView, PaperConfig, PredictConfig, Stabilizer, StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import TRACKERS, SteadiedTracker, TrackerGroup, load_tracker

__all__ = [
    "TRACKERS",
    "ArgumentError",
    "CameraMotion",
    "CopyError",
    "FrameSizeError",
    "FrameView",
    "MissingExtraError",
    "Motion",
    "PaperConfig",
    "PredictConfig",
    "SinkError",
    "SourceError",
    "SsiamError",
    "Stabilizer",
    "StabilizerConfig",
    "SteadiedTracker",
    "StreamError",
    "Track",
    "TrackerGroup",
    "WeightsError",
    "load_tracker",
]
