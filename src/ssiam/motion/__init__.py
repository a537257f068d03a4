"""What the camera did between two frames: keypoints, optical flow, rigid fit."""

from ssiam.motion.motion import Motion

__all__ = ["Motion"]
