"""Camera shake with known ground truth: any sequence as a shaking camera would record it."""

from ssiam.datasets.shake.camera import (
    SHAKE_BORDERS,
    Shake,
    ShakeBorder,
    ShakingCamera,
    camera_path,
)
from ssiam.datasets.shake.path import SHAKE_KINDS, ShakeKind
from ssiam.datasets.shake.sequence import ShakenSequence, shaken, shaken_dataset

__all__ = [
    "SHAKE_BORDERS",
    "SHAKE_KINDS",
    "Shake",
    "ShakeBorder",
    "ShakeKind",
    "ShakenSequence",
    "ShakingCamera",
    "camera_path",
    "shaken",
    "shaken_dataset",
]
