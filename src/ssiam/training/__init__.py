"""Training of the small trackers' networks, with pairs of crops from many datasets.

Importing this package does not import PyTorch; `ssiam.training.trainer` does.
"""

from ssiam.training.data.batches import Batch, load_batches
from ssiam.training.data.pairs import PairSampler
from ssiam.training.data.registry import LAYOUTS, SourceSettings, open_training_source
from ssiam.training.data.settings import AugmentSettings, CropSettings, PairSettings
from ssiam.training.data.tracks import Source, TrackList, TrainingTrack

__all__ = [
    "LAYOUTS",
    "AugmentSettings",
    "Batch",
    "CropSettings",
    "PairSampler",
    "PairSettings",
    "Source",
    "SourceSettings",
    "TrackList",
    "TrainingTrack",
    "load_batches",
    "open_training_source",
]
