"""From the camera motion to a stabilized view of each frame."""

from ssiam.stabilize.config import METHODS, Method, PaperConfig, PredictConfig, StabilizerConfig
from ssiam.stabilize.predictor import TargetPredictor
from ssiam.stabilize.stabilizer import CameraPath, Stabilizer
from ssiam.stabilize.view import Crop, FrameView

__all__ = [
    "METHODS",
    "CameraPath",
    "Crop",
    "FrameView",
    "Method",
    "PaperConfig",
    "PredictConfig",
    "Stabilizer",
    "StabilizerConfig",
    "TargetPredictor",
]
