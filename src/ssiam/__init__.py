"""Track a chosen object in video from a shaking, moving camera.

The method is "Real-time Tracking with Stabilized Frame" (S-Siam, 2020): estimate the camera's
motion, stabilize the frame, run an unchanged tracker on the stabilized view, map the result back.

    tracker = ssiam.load_tracker()
    tracker.init(frame, (x, y, w, h))
    track = tracker.update(next_frame)

Names and subpackages (`ssiam.video`, `ssiam.exchange`, `ssiam.datasets`, ...) are imported when
they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ssiam.opencv_wheels import warn_of_several

if TYPE_CHECKING:
    from ssiam import datasets as datasets
    from ssiam import errors as errors
    from ssiam import exchange as exchange
    from ssiam import geometry as geometry
    from ssiam import render as render
    from ssiam import video as video
    from ssiam import web as web
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

__version__ = "0.1.0"

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

_MODULES = {
    "CameraMotion": "motion",
    "FrameView": "stabilize",
    "Motion": "motion",
    "StabilizedTracker": "trackers",
    "Stabilizer": "stabilize",
    "StabilizerConfig": "stabilize",
    "TRACKERS": "trackers",
    "Track": "track",
    "TrackerGroup": "trackers",
    "load_tracker": "trackers",
}
_SUBPACKAGES = {
    *("datasets", "errors", "exchange", "geometry", "motion", "render"),
    *("stabilize", "testing", "track", "trackers", "video", "web"),
}


def __getattr__(name: str) -> Any:
    if name in _SUBPACKAGES:
        return import_module(f"ssiam.{name}")
    if name not in __all__:
        raise AttributeError(f"module 'ssiam' has no attribute {name!r}")
    value = getattr(import_module(f"ssiam.{_MODULES.get(name, 'errors')}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_SUBPACKAGES})


warn_of_several()
