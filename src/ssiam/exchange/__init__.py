"""Tracks for other programs: annotation tools, supervision, Rerun."""

from ssiam.errors import AnnotationsError
from ssiam.exchange.annotations import Annotation, Annotations, annotation_from_track
from ssiam.exchange.blending import Blend, Keyframe, Run, Section, blend, sections
from ssiam.exchange.corrections import read_any_annotations, read_corrections
from ssiam.exchange.cvat import CvatShape
from ssiam.exchange.detections import to_detections
from ssiam.exchange.doubts import Doubt, doubtful_frames
from ssiam.exchange.exports import EXPORT_KINDS, ExportKind, write_exports
from ssiam.exchange.labelstudio import Timeline, timeline
from ssiam.exchange.mask_edges import with_mask_edges
from ssiam.exchange.rerun import RerunLog
from ssiam.exchange.result_files import read_annotations

__all__ = [
    "EXPORT_KINDS",
    "Annotation",
    "Annotations",
    "AnnotationsError",
    "Blend",
    "CvatShape",
    "Doubt",
    "ExportKind",
    "Keyframe",
    "RerunLog",
    "Run",
    "Section",
    "Timeline",
    "annotation_from_track",
    "blend",
    "doubtful_frames",
    "read_annotations",
    "read_any_annotations",
    "read_corrections",
    "sections",
    "timeline",
    "to_detections",
    "with_mask_edges",
    "write_exports",
]
