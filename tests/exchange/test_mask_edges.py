"""The edges of masks in the boxes of a track, as far as the keyframes agree with them."""

import numpy as np
import pytest

from ssiam.errors import ArgumentError
from ssiam.exchange import Blend, Keyframe, Section, with_mask_edges

COUNT, GIVEN = 21, (0, 20)


def truth():
    """A target that becomes wide and narrow again."""
    frames = np.arange(COUNT)
    w = 40 + 20 * np.sin(frames / 20 * np.pi)
    return np.stack([100 - w / 2, np.full(COUNT, 50.0), w, np.full(COUNT, 60.0)], axis=1)


def section():
    return Section(0, COUNT - 1, tuple(Keyframe(f, tuple(truth()[f])) for f in GIVEN))


def track_of(boxes, straight=0.0):
    nothing = np.zeros(COUNT)
    shares = np.full(COUNT, straight)
    return Blend(boxes, nothing + 0.9, nothing > 0, nothing + 1, nothing, shares)


def constant():
    """The width stays that of the keyframes."""
    return np.tile(truth()[0], (COUNT, 1))


def wider(factor):
    """Masks of the target and of what is beside it."""
    boxes = truth()
    boxes[:, 0] -= (factor - 1) / 2 * boxes[:, 2]
    boxes[:, 2] *= factor
    return boxes


def widths(bounds, track):
    return with_mask_edges(section(), track, bounds).boxes[:, 2]


def test_widths_are_halfway_between_track_and_masks():
    track = track_of(constant())
    found = widths(np.stack([wider(1.0)], axis=1), track)
    assert found == pytest.approx((40 + truth()[:, 2]) / 2)


def test_the_threshold_is_chosen_and_corrected_on_the_keyframes():
    bounds = np.stack([wider(3.0), wider(1.1), np.full((COUNT, 4), np.nan)], axis=1)
    found = widths(bounds, track_of(constant()))
    assert found == pytest.approx((40 + truth()[:, 2]) / 2, abs=0.3)
    assert found[list(GIVEN)] == pytest.approx([40, 40], abs=0)


def test_masks_of_another_object_are_not_used():
    track = track_of(constant())
    assert widths(np.stack([wider(1.6)], axis=1), track) == pytest.approx(40)


def test_straight_lines_and_frames_without_mask_stay():
    bounds = wider(1.0)[:, None]
    assert widths(bounds, track_of(constant(), straight=1.0)) == pytest.approx(40)
    bounds[10] = np.nan
    found = widths(bounds, track_of(constant()))
    assert found[10] == pytest.approx(40)
    assert found[9] == pytest.approx((40 + truth()[9, 2]) / 2)


def test_bounds_of_other_frames_are_refused():
    with pytest.raises(ArgumentError, match=r"shape \(20, 1, 4\): expected \(21, thresholds, 4\)"):
        with_mask_edges(section(), track_of(constant()), wider(1.0)[1:, None])
