"""From the camera's motion to a steadied view of each frame."""

from ssiam.stabilize.config import METHODS, Method, StabilizerConfig
from ssiam.stabilize.prediction import Prediction
from ssiam.stabilize.stabilizer import CameraPath, Stabilizer
from ssiam.stabilize.view import FrameView

__all__ = [
    "METHODS",
    "CameraPath",
    "FrameView",
    "Method",
    "Prediction",
    "Stabilizer",
    "StabilizerConfig",
]
