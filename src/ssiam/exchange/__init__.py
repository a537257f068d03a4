"""Tracks for other programs: annotation tools, supervision, Rerun."""

from ssiam.errors import AnnotationsError
from ssiam.exchange.annotations import Annotation, Annotations, annotation_of, read_annotations
from ssiam.exchange.detections import to_detections
from ssiam.exchange.exports import EXPORT_KINDS, ExportKind, write_exports
from ssiam.exchange.rerun_log import RerunLog
from ssiam.exchange.timeline import Timeline, timeline

__all__ = [
    "EXPORT_KINDS",
    "Annotation",
    "Annotations",
    "AnnotationsError",
    "ExportKind",
    "RerunLog",
    "Timeline",
    "annotation_of",
    "read_annotations",
    "timeline",
    "to_detections",
    "write_exports",
]
