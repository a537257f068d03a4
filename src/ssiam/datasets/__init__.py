"""Datasets of tracking as they lie on disk: frames, where the target truly is, and tags."""

from ssiam.datasets.boxes import parse_boxes, read_boxes
from ssiam.datasets.clips import read_clip
from ssiam.datasets.dataset import Dataset
from ssiam.datasets.errors import DatasetError, UnknownSequenceError
from ssiam.datasets.opening import KINDS, open_dataset
from ssiam.datasets.sequence import Sequence, read_image

__all__ = [
    "KINDS",
    "Dataset",
    "DatasetError",
    "Sequence",
    "UnknownSequenceError",
    "open_dataset",
    "parse_boxes",
    "read_boxes",
    "read_clip",
    "read_image",
]
