"""What the camera did between two frames: alignment of all its pixels, or keypoints and flow."""

from ssiam.motion.camera import KEYPOINTS, CameraMotion, KeypointName, MotionAhead
from ssiam.motion.fit import FitName
from ssiam.motion.models import ModelName
from ssiam.motion.motion import Motion

__all__ = [
    "KEYPOINTS",
    "CameraMotion",
    "FitName",
    "KeypointName",
    "ModelName",
    "Motion",
    "MotionAhead",
]
