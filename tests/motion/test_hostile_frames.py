"""Some hundred frames of `benchmarks/motion/hostile.py`."""

import numpy as np
import pytest

from helpers.hostile_frames import KINDS, checked_stream, hostile_boxes, stream
from ssiam import CameraMotion
from ssiam.errors import ArgumentError


@pytest.mark.parametrize("seed", range(8))
def test_every_motion_is_finite_and_plausible(seed):
    assert [fault for _, _, fault in checked_stream(seed, 60) if fault] == []


def test_the_streams_show_every_kind():
    shown = {
        kind for seed in range(20) for (kind, _), _ in zip(stream(seed), range(60), strict=False)
    }
    assert shown == {draw.__name__ for draw in KINDS}


def test_boxes_that_are_not_finite_are_refused_and_change_nothing():
    camera, twin = CameraMotion(), CameraMotion()
    for (_, frame), _ in zip(stream(2), range(10), strict=False):
        for value in (np.nan, np.inf, -np.inf):
            with pytest.raises(ArgumentError, match="exclude is"):
                camera.update(frame, (1, 2, value, 4))
        expected = twin.update(frame).cur_from_prev
        np.testing.assert_array_equal(camera.update(frame).cur_from_prev, expected)


def test_a_degenerate_homography_is_not_reliable():
    """Single bright pixels in black, which one homography out of many fits."""
    camera = CameraMotion(model="homography")
    for (_, frame), _ in zip(stream(19), range(40), strict=False):
        assert camera.update(frame).is_plausible
    rng = np.random.default_rng(0)
    assert any(not np.isfinite(hostile_boxes(rng, (9, 9))[0]).all() for _ in range(99))


def test_a_motion_is_plausible_in_the_bars_too():
    """Frame 127 of this stream: a homography that is possible in the content alone."""
    assert not [fault for _, _, fault in checked_stream(523, 128) if fault]
