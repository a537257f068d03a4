"""The optional folder of test data: real sequences with ground truth, clips, weights.

Its place is told by the environment variable SSIAM_SHARED; the default is ../shared beside the
checkout. Nothing in it belongs to this project, and none of it is copied here.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from ssiam.datasets import Sequence, open_dataset

SHARED = Path(os.environ.get("SSIAM_SHARED", Path(__file__).parents[2] / "shared"))
SEQUENCES = SHARED / "data" / "sequences"
WEIGHTS = SHARED / "data" / "weights"
RESERVE = SHARED / "data" / "reserve"  # reports, and chooses nothing
MOT = SHARED / "data" / "mot"
VIDEOS = SHARED / "data" / "videos"


def sequences(folder: Path = SEQUENCES, *, as_published: bool = False) -> Mapping[str, Sequence]:
    """The real sequences of a folder by name, 0-based unless `as_published`."""
    if not folder.is_dir():
        raise SystemExit(f"{folder} is absent: set SSIAM_SHARED to the folder of the test data")
    return open_dataset(folder, as_published=as_published).sequences
