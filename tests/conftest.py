import os
import signal
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import settings

from ssiam.runtime import openvino
from ssiam.trackers.lite import SHIPPED

SHARED = Path(os.environ.get("SSIAM_SHARED", Path(__file__).parents[2] / "shared"))

cv2.setNumThreads(1)
# A shell starts background jobs with SIGINT ignored, nohup ignores SIGHUP, and child processes
# inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
# A busy machine is no failure.
settings.register_profile("no-deadline", deadline=None)
settings.load_profile("no-deadline")


@pytest.fixture(scope="session", autouse=True)
def _networks_compiled_once():
    """Trackers share the shipped networks and those of the test data: compiling takes .5 s."""
    load, share = openvino.OpenVinoNetwork, cache(openvino.OpenVinoNetwork)

    def shared_or_new(path, *arguments, **options):
        is_shared = {SHIPPED, SHARED / "data" / "weights"} & set(path.parents)
        return (share if is_shared and not options else load)(path, *arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(openvino, "OpenVinoNetwork", shared_or_new)
        yield


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
