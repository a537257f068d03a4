"""A virtual camera: the image that is written, moved independently of the camera that shot it."""

from ssiam.render.crop import AUTO_CROP, Crop
from ssiam.render.path import ScenePath
from ssiam.render.shake import ShakeMeter
from ssiam.render.stabilized import StabilizedCamera, stabilized_views
from ssiam.render.view import Border, CameraView, Renderer

__all__ = [
    "AUTO_CROP",
    "Border",
    "CameraView",
    "Crop",
    "Renderer",
    "ScenePath",
    "ShakeMeter",
    "StabilizedCamera",
    "stabilized_views",
]
