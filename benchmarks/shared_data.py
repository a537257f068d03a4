"""The optional folder of test data: real sequences with ground truth, clips, weights.

Its place is told by the environment variable SSIAM_SHARED; the default is ../shared beside the
checkout. Nothing in it belongs to this project, and none of it is copied here.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import area_preserving_xywh

SHARED = Path(os.environ.get("SSIAM_SHARED", Path(__file__).parents[2] / "shared"))
SEQUENCES = SHARED / "data" / "sequences"
WEIGHTS = SHARED / "data" / "weights"
VIDEOS = SHARED / "data" / "videos"


@dataclass(frozen=True)
class Sequence:
    """Frames and ground truth of one sequence.

    Attributes
    ----------
    name : str
    frames : Path
        Folder of images.
    boxes : (N, 4) float64
        x, y, w, h of the target in each frame, 0-based pixels.
    """

    name: str
    frames: Path
    boxes: NDArray[np.float64]


def read_sequence(name: str, *, as_published: bool = False) -> Sequence:
    """A sequence in the layout it was published in.

    OTB's boxes are 1-based and are brought to 0-based ones, unless `as_published`.
    """
    folder = SEQUENCES / name
    if not folder.is_dir():
        raise SystemExit(f"{folder} is absent: set SSIAM_SHARED to the folder of the test data")
    frames = next((folder / sub for sub in ("img", "imgs") if (folder / sub).is_dir()), folder)
    truth = next(
        folder / file
        for file in ("groundtruth_rect.txt", "groundtruth.txt", f"{name.split('_', 1)[-1]}.txt")
        if (folder / file).is_file()
    )
    lines = truth.read_text().splitlines()
    rows = [[float(v) for v in re.split(r"[,\s]+", line.strip())] for line in lines if line.strip()]
    if len(rows[0]) == 8:
        boxes = np.array([area_preserving_xywh(row) for row in rows])
    else:
        boxes = np.array(rows)
    if truth.name == "groundtruth_rect.txt" and not as_published:
        boxes[:, :2] -= 1
    return Sequence(name, frames, boxes)


def overlap(xywh: NDArray[np.float64], other_xywh: NDArray[np.float64]) -> NDArray[np.float64]:
    """Intersection over union of boxes (N, 4), row by row."""
    top_left = np.maximum(xywh[:, :2], other_xywh[:, :2])
    bottom_right = np.minimum(xywh[:, :2] + xywh[:, 2:], other_xywh[:, :2] + other_xywh[:, 2:])
    shared = np.clip(bottom_right - top_left, 0, None).prod(axis=1)
    union = xywh[:, 2:].prod(axis=1) + other_xywh[:, 2:].prod(axis=1) - shared
    return np.asarray(shared / union)


def success(overlaps: NDArray[np.float64]) -> float:
    """Mean success over the 21 thresholds 0, 0.05, ... 1 (OTB's area under the curve)."""
    return float(np.mean([(overlaps > threshold).mean() for threshold in np.linspace(0, 1, 21)]))
