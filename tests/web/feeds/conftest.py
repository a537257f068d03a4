from __future__ import annotations

import threading
from fractions import Fraction

import pytest

from helpers.opened_feeds import wait_for
from helpers.video_clips import write_clip


@pytest.fixture(autouse=True)
def _no_thread_is_left():
    yield
    wait_for(lambda: not [t for t in threading.enumerate() if t.name == "ssiam-feed"])


@pytest.fixture(scope="session")
def clip(tmp_path_factory):
    """30 frames at 50 frames per second."""
    return write_clip(tmp_path_factory.mktemp("clip") / "clip.mp4", 30, rate=Fraction(50))
