"""What the camera did between two frames: keypoints, optical flow, rigid fit."""

from ssiam.motion.camera import CameraMotion
from ssiam.motion.fit import FitName, ModelName
from ssiam.motion.keypoints import KeypointName
from ssiam.motion.motion import Motion

__all__ = ["CameraMotion", "FitName", "KeypointName", "ModelName", "Motion"]
