"""Tracks for other programs: annotation tools, supervision, Rerun."""

from ssiam.errors import AnnotationsError
from ssiam.exchange.annotations import Annotation, Annotations, annotation_from_track
from ssiam.exchange.detections import to_detections
from ssiam.exchange.exports import EXPORT_KINDS, ExportKind, write_exports
from ssiam.exchange.labelstudio import Timeline, timeline
from ssiam.exchange.rerun import RerunLog
from ssiam.exchange.result_files import read_annotations

__all__ = [
    "EXPORT_KINDS",
    "Annotation",
    "Annotations",
    "AnnotationsError",
    "ExportKind",
    "RerunLog",
    "Timeline",
    "annotation_from_track",
    "read_annotations",
    "timeline",
    "to_detections",
    "write_exports",
]
