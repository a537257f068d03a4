"""The optional folder of test data: real sequences with ground truth, videos, weights.

The environment variable SSIAM_SHARED names the folder; the default is ../shared next to the
checkout. Its contents are not part of this project.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from ssiam.datasets import VideoSequence, open_dataset
from ssiam.geometry import Image

CHECKOUT = Path(__file__).resolve().parents[2]
EXAMPLES = CHECKOUT / "examples"
SHARED = Path(os.environ.get("SSIAM_SHARED", CHECKOUT.parent / "shared"))
SEQUENCES = SHARED / "data" / "sequences"
WEIGHTS = SHARED / "data" / "weights"
RESERVE = SHARED / "data" / "reserve"  # only reported, never used to choose anything
MOT = SHARED / "data" / "mot"
VIDEOS = SHARED / "data" / "videos"


def sequences(
    folder: Path = SEQUENCES, *, as_published: bool = False
) -> Mapping[str, VideoSequence]:
    """The real sequences of a folder by name; 0-based boxes unless `as_published`."""
    if not folder.is_dir():
        raise SystemExit(f"{folder} is absent: set SSIAM_SHARED to the folder of the test data")
    return open_dataset(folder, as_published=as_published).sequences


def read_bgr(path: Path) -> Image:
    """An image file as (H, W, 3) uint8 BGR, as `cv2.imread` decodes it."""
    image = cv2.imread(str(path))
    if image is None:
        raise SystemExit(f"{path}: is missing, or is not an image")
    return np.asarray(image, np.uint8)


def nanotrack_weights(tracker: str) -> Path:
    """Folder of the weights of "nanotrack_v1", "nanotrack_v2" or "nanotrack_v3"."""
    return WEIGHTS / tracker.replace("_", "")
