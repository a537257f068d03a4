"""A virtual camera: the image that is written, moved independently of the camera that shot it."""

from ssiam.render.crop import AUTO_CROP, Crop
from ssiam.render.locked import locked_views
from ssiam.render.locked_config import LockedConfig
from ssiam.render.locked_live import LockedCamera
from ssiam.render.path import ScenePath
from ssiam.render.shake import ShakeMeter
from ssiam.render.stabilized import StabilizedCamera, stabilized_views
from ssiam.render.view import Border, CameraView, Renderer

__all__ = [
    "AUTO_CROP",
    "Border",
    "CameraView",
    "Crop",
    "LockedCamera",
    "LockedConfig",
    "Renderer",
    "ScenePath",
    "ShakeMeter",
    "StabilizedCamera",
    "locked_views",
    "stabilized_views",
]
