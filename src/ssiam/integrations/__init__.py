"""Trackers in the forms that annotation tools call: CVAT's agents and Label Studio's ML backend."""

from ssiam.integrations.label_studio_backend import LabelStudioBackend

__all__ = ["LabelStudioBackend"]
