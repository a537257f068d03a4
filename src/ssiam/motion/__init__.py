"""Camera motion between frames, by direct alignment or by keypoints and optical flow."""

from ssiam.motion.camera import KEYPOINTS, CameraMotion, KeypointName, PrefetchingCameraMotion
from ssiam.motion.fit import FitName
from ssiam.motion.models import CameraModelName, ModelName
from ssiam.motion.motion import Motion

__all__ = [
    "KEYPOINTS",
    "CameraModelName",
    "CameraMotion",
    "FitName",
    "KeypointName",
    "ModelName",
    "Motion",
    "PrefetchingCameraMotion",
]
