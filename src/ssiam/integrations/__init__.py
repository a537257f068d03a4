"""Trackers in the forms that annotation tools call, and camera motion in those that trackers call.

CVAT's agents (`cvat_agent`) and Label Studio's ML backend (`LabelStudioBackend`); norfair,
ultralytics, boxmot, roboflow's trackers and supervision. None of them is imported.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ssiam.integrations.label_studio_backend import LabelStudioBackend

__all__ = ["LabelStudioBackend"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'ssiam.integrations' has no attribute {name!r}")
    return getattr(import_module("ssiam.integrations.label_studio_backend"), name)
