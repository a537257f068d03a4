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
VIDEOS = SHARED / "data" / "videos"


def sequences(*, as_published: bool = False) -> Mapping[str, Sequence]:
    """The real sequences by name, 0-based unless `as_published`."""
    if not SEQUENCES.is_dir():
        raise SystemExit(f"{SEQUENCES} is absent: set SSIAM_SHARED to the folder of the test data")
    return open_dataset(SEQUENCES, as_published=as_published).sequences
