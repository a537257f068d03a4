"""Motions that are not finite or carry the target away: an error of ssiam, never of arithmetic."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

import ssiam
from helpers.synthetic import generator
from ssiam.errors import ArgumentError, TrackingError
from ssiam.geometry import IDENTITY
from ssiam.motion import Motion

SIZE = (160, 120)
IMPOSSIBLE = {
    "NaN": np.full((3, 3), np.nan),
    "infinite": np.diag([np.inf, 1, 1]),
    "singular": np.diag([1.0, 0, 1]),
    "far": np.array([[1, 0, 1e100], [0, 1, 0], [0, 0, 1.0]]),
    "huge": np.eye(3) * 1e200,
    "large zoom": np.diag([1e100, 1e100, 1]),
    "small zoom": np.diag([1e-5, 1e-5, 1]),
    "horizon through the frame": np.array([[1, 0, 0], [0, 1, 0], [1, 0, -55.0]]),
    "horizon at a corner": np.array([[1, 0, 0], [0, 1, 0], [1 / 160, 0, -1.0]]),
}


@pytest.fixture(scope="module")
def frame():
    return generator(0).integers(0, 255, (120, 160, 3), dtype=np.uint8)


@pytest.mark.parametrize("matrix", IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_impossible_motions_are_refused(frame, matrix):
    with pytest.raises(ArgumentError, match="give "):
        Motion.from_transform(matrix, SIZE)
    tracker = ssiam.load_tracker("kcf")
    tracker.init(frame, (40, 40, 30, 30))
    motion = Motion(matrix, 1.0, True, SIZE)
    for given in (matrix, motion):
        with pytest.raises(ArgumentError):
            tracker.update(frame, motion=given)
    with pytest.raises(ArgumentError):
        tracker.advance(motion)
    assert np.isfinite(tracker.update(frame, motion=IDENTITY).box).all()


@pytest.mark.parametrize("stabilize", ["predict", "paper"])
@pytest.mark.parametrize(
    "matrix",
    [
        np.array([[1, 0, 1e5], [0, 1, 0], [0, 0, 1.0]]),
        np.diag([30.0, 30.0, 1]),
        np.diag([0.03, 0.03, 1]),
        np.array([[1, 0, 0], [0, 1, 0], [0.005, 0, 1.0]]),
    ],
    ids=["shift", "zoom in", "zoom out", "tilt"],
)
def test_motions_that_add_up_are_reported(frame, stabilize, matrix):
    tracker = ssiam.load_tracker("kcf", stabilize=stabilize)
    tracker.init(frame, (40, 40, 30, 30))
    for _ in range(12):
        with suppress(TrackingError):
            assert np.isfinite(tracker.update(frame, motion=matrix).box).all()
    tracker.init(frame, (40, 40, 30, 30))
    assert np.isfinite(tracker.update(frame).box).all()
