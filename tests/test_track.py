"""Outlines of tracks are computed when they are first read."""

import copy
import gc
import pickle
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from ssiam.track import Outline, PendingOutline, Track

BOX = (2.0, 1.0, 4.0, 3.0)
CORNERS = np.array([[2.0, 1.0], [6.0, 1.0], [6.0, 4.0], [2.0, 4.0]])
MASK = np.zeros((8, 10), np.bool_)
MASK[1:4, 2:6] = True
RIGHT_BY_2 = np.array([[1.0, 0, 2], [0, 1, 0], [0, 0, 1]])


class Computation:
    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return Outline(CORNERS, MASK)


def pending():
    compute = Computation()
    outline = PendingOutline(compute)
    return compute, Track(BOX, 0.5, corners=outline, mask=outline)


def test_nothing_is_computed_before_it_is_read():
    compute, track = pending()
    mapped = track.mapped(RIGHT_BY_2, (10, 8)).with_changes(lost=True)
    copy.deepcopy(mapped)
    repr(mapped)
    assert mapped.lost
    assert compute.calls == 0


def test_it_is_computed_once():
    compute, track = pending()
    mapped = track.mapped(RIGHT_BY_2, (10, 8))
    np.testing.assert_array_equal(mapped.corners, np.add(CORNERS, (2, 0)))
    np.testing.assert_array_equal(mapped.mask[1:4, 4:8], True)
    assert mapped.mask.sum() == MASK.sum()
    np.testing.assert_array_equal(track.mask, MASK)
    assert compute.calls == 1


def test_mapped_is_as_of_a_computed_outline():
    _, track = pending()
    whole = Track(BOX, 0.5, corners=CORNERS, mask=MASK)
    expected, found = (each.mapped(RIGHT_BY_2, (10, 8)) for each in (whole, track))
    assert found.box == expected.box
    np.testing.assert_array_equal(found.corners, expected.corners)
    np.testing.assert_array_equal(found.mask, expected.mask)


def test_what_it_was_computed_from_is_released():
    compute, track = pending()
    mapped = track.mapped(RIGHT_BY_2, (10, 8))
    alive = weakref.ref(compute)
    del compute, track
    gc.collect()
    assert alive() is not None
    assert mapped.mask is not None
    gc.collect()
    assert alive() is None


def test_threads_get_the_same_mask():
    compute, track = pending()
    with ThreadPoolExecutor(8) as pool:
        masks = list(pool.map(lambda _: track.mask, range(64)))
    assert all(mask is masks[0] for mask in masks)
    assert compute.calls == 1


def test_a_failed_computation_is_tried_again():
    outcomes = [RuntimeError("no memory"), Outline(CORNERS, MASK)]

    def compute():
        outcome = outcomes.pop(0)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    track = Track(BOX, mask=PendingOutline(compute))
    with pytest.raises(RuntimeError, match="no memory"):
        _ = track.mask
    assert track.mask is MASK


def test_it_can_be_pickled():
    _, track = pending()
    copied = pickle.loads(pickle.dumps(track))
    np.testing.assert_array_equal(copied.mask, MASK)
    np.testing.assert_array_equal(copied.corners, CORNERS)


def test_replace_keeps_it():
    _, track = pending()
    assert replace(track, lost=True).mask is MASK


def test_corners_may_be_given_beside_a_pending_mask():
    outline = PendingOutline(Computation())
    mapped = Track(BOX, corners=CORNERS * 2, mask=outline).mapped(RIGHT_BY_2, (10, 8))
    np.testing.assert_array_equal(mapped.corners, np.add(CORNERS * 2, (2, 0)))


def test_a_track_without_an_outline():
    mapped = Track(BOX).mapped(RIGHT_BY_2, (10, 8))
    assert mapped.corners is None
    assert mapped.mask is None
    assert mapped.box == (4.0, 1.0, 4.0, 3.0)


def test_a_track_is_frozen():
    with pytest.raises(FrozenInstanceError):
        Track(BOX).mask = MASK


def test_repr_is_short():
    assert (
        repr(Track((53.2, 114.1, 26.5, 66.4), 0.9812)) == "Track(box=(53, 114, 26, 66), score=0.98)"
    )
    assert repr(Track(BOX, lost=True)) == "Track(box=(2, 1, 4, 3), score=1.00, lost=True)"


def test_changes_are_of_fields_and_leave_the_track():
    track = Track(BOX, 0.5, mask=MASK)
    changed = track.with_changes(score=0.25, lost=True)
    assert vars(changed) == vars(replace(track, score=0.25, lost=True))
    assert (track.score, track.lost) == (0.5, False)
    with pytest.raises(TypeError, match="boxes"):
        track.with_changes(boxes=BOX)
