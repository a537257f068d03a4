import os
import signal
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import settings

SHARED = Path(os.environ.get("SSIAM_SHARED", Path(__file__).parents[2] / "shared"))

cv2.setNumThreads(1)
# A shell starts background jobs with SIGINT ignored, and child processes inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
# A busy machine is no failure.
settings.register_profile("no-deadline", deadline=None)
settings.load_profile("no-deadline")


@pytest.fixture
def golden():
    """Read an .npz of tests/golden."""
    return lambda name: np.load(Path(__file__).parent / "golden" / name)


@pytest.fixture
def shared():
    """A file or folder of the shared test data; skips the test where it is absent."""

    def find(relative):
        path = SHARED / relative
        if not path.exists():
            pytest.skip(f"{path} is absent (set SSIAM_SHARED to the folder of the test data)")
        return path

    return find
