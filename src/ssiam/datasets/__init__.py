"""Readers for tracking datasets in their published folder layouts: frames, ground truth, tags."""

from ssiam.datasets.clips import read_clip
from ssiam.datasets.dataset import Dataset
from ssiam.datasets.ground_truth import parse_boxes, read_boxes
from ssiam.datasets.images import read_image
from ssiam.datasets.registry import KINDS, open_dataset
from ssiam.datasets.sequence import VideoSequence
from ssiam.datasets.shake import (
    SHAKE_BORDERS,
    SHAKE_KINDS,
    Shake,
    ShakeBorder,
    ShakeKind,
    ShakenSequence,
    camera_path,
    shaken,
    shaken_dataset,
)
from ssiam.errors import DatasetError, UnknownSequenceError

__all__ = [
    "KINDS",
    "SHAKE_BORDERS",
    "SHAKE_KINDS",
    "Dataset",
    "DatasetError",
    "Shake",
    "ShakeBorder",
    "ShakeKind",
    "ShakenSequence",
    "UnknownSequenceError",
    "VideoSequence",
    "camera_path",
    "open_dataset",
    "parse_boxes",
    "read_boxes",
    "read_clip",
    "read_image",
    "shaken",
    "shaken_dataset",
]
