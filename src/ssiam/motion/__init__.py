"""Camera motion between frames, by direct alignment or by keypoints and optical flow."""

from ssiam.motion.camera import (
    KEYPOINTS,
    MODELS,
    CameraMotion,
    KeypointName,
    MaskOf,
    PrefetchingCameraMotion,
)
from ssiam.motion.fit import FitName
from ssiam.motion.gyro import GyroCameraMotion, GyroSync, GyroTrack, synchronize
from ssiam.motion.gyro_files import read_gyro
from ssiam.motion.mesh import MotionMesh
from ssiam.motion.models import CameraModelName, ModelName
from ssiam.motion.motion import Motion

__all__ = [
    "KEYPOINTS",
    "MODELS",
    "CameraModelName",
    "CameraMotion",
    "FitName",
    "GyroCameraMotion",
    "GyroSync",
    "GyroTrack",
    "KeypointName",
    "MaskOf",
    "ModelName",
    "Motion",
    "MotionMesh",
    "PrefetchingCameraMotion",
    "read_gyro",
    "synchronize",
]
