"""Training of a tracker's network: pairs of crops from many sets of data."""

from ssiam.training.augment import AugmentSettings
from ssiam.training.batches import Batch
from ssiam.training.loading import load_batches
from ssiam.training.opening import LAYOUTS, SourceSettings, open_training_source
from ssiam.training.pair_settings import PairSettings
from ssiam.training.pairs import PairSampler
from ssiam.training.sources import Source, TrackList, TrainingTrack
from ssiam.training.windows import WindowSettings

__all__ = [
    "LAYOUTS",
    "AugmentSettings",
    "Batch",
    "PairSampler",
    "PairSettings",
    "Source",
    "SourceSettings",
    "TrackList",
    "TrainingTrack",
    "WindowSettings",
    "load_batches",
    "open_training_source",
]
