"""Rivals are known by their places, however much they look like the target for a moment."""

import numpy as np
import pytest

from ssiam.trackers.rivals import Rivals
from ssiam.trackers.siamese import TargetState

SIDE, STEP = 32, 8  # cells, and view pixels between them
SIZE = 60.0  # px, of the target
TARGET, RIVAL = (100.0, 124.0), (180.0, 116.0)
PLACES = np.stack(np.meshgrid(*[np.arange(SIDE) * STEP + 4.0] * 2), axis=-1).reshape(-1, 2)


def looks(*things):
    """Score maps in which things (x, y, score) are seen."""
    bumps = [score * np.exp(-(((PLACES - (x, y)) / 10) ** 2).sum(axis=1)) for x, y, score in things]
    return np.max([np.zeros(SIDE**2), *bumps], axis=0)


def cell(xy):
    return int(np.linalg.norm(PLACES - xy, axis=1).argmin())


def seen(rivals, own_xy, *things):
    """The candidate that is best of those not taken; it is followed."""
    score = looks(*things)
    taken = rivals.taken(PLACES, score, TargetState(own_xy, (SIZE, SIZE)))
    best = int(np.where(taken, -1, score).argmax())
    rivals.follow(best)
    return best


@pytest.fixture
def rivals():
    """Five frames of a target and something like it."""
    known = Rivals()
    for _ in range(5):
        assert seen(known, TARGET, (*TARGET, 0.6), (*RIVAL, 0.3)) == cell(TARGET)
    return known


def test_a_rival_that_looks_better_for_once_is_not_taken_for_the_target(rivals):
    assert seen(rivals, TARGET, (*TARGET, 0.3), (*RIVAL, 0.7)) == cell(TARGET)


def test_where_the_target_is_not_seen_a_rival_may_be_it(rivals):
    """Or a wrong choice could never be taken back."""
    assert seen(rivals, TARGET, (*TARGET, 0.02), (*RIVAL, 0.7)) == cell(RIVAL)


def test_rivals_are_followed(rivals):
    (x, y), (own_x, own_y) = RIVAL, TARGET
    for t in range(1, 8):
        things = (own_x, own_y - 8 * t, 0.5), (x, y + 16 * t, 0.3)
        assert seen(rivals, (own_x, own_y - 8 * t), *things) == cell((own_x, own_y - 8 * t))
    assert seen(rivals, (own_x, own_y - 56), (own_x, own_y - 56, 0.3), (x, y + 128, 0.8)) == cell(
        (own_x, own_y - 56)
    )


def test_a_rival_that_was_hidden_for_a_moment_is_still_one(rivals):
    for _ in range(3):
        seen(rivals, TARGET, (*TARGET, 0.6))
    assert seen(rivals, TARGET, (*TARGET, 0.3), (*RIVAL, 0.7)) == cell(TARGET)


def test_a_target_that_jumps_is_followed(rivals):
    """To where nothing was."""
    assert seen(rivals, TARGET, (40, 40, 0.7), (*RIVAL, 0.3)) == cell((40, 40))


def test_what_looks_better_for_long_is_the_target(rivals):
    for _ in range(12):
        best = seen(rivals, TARGET, (*TARGET, 0.2), (*RIVAL, 0.6))
    assert best == cell(RIVAL)


def test_beside_a_target_that_is_hardly_seen_for_long_nothing_is_taken():
    """It may have gone behind another one, and this one is what is seen in its place."""
    rivals = Rivals()
    for _ in range(8):
        seen(rivals, TARGET, (*TARGET, 0.32), (*RIVAL, 0.15))
    assert seen(rivals, TARGET, (*TARGET, 0.32), (*RIVAL, 0.5)) == cell(RIVAL)


def test_what_is_new_is_no_rival():
    rivals = Rivals()
    seen(rivals, TARGET, (*TARGET, 0.6), (*RIVAL, 0.3))
    assert seen(rivals, TARGET, (*TARGET, 0.3), (*RIVAL, 0.7)) == cell(RIVAL)


def test_a_rival_beside_the_target_hides_nothing_of_it(rivals):
    (x, y), (own_x, own_y) = RIVAL, TARGET
    beside = own_x + 0.6 * SIZE
    for t in np.linspace(0, 1, 8):
        seen(rivals, TARGET, (*TARGET, 0.6), (x + t * (beside - x), y + t * (own_y - y), 0.3))
    score = looks((*TARGET, 0.3), (beside, own_y, 0.7))
    taken = rivals.taken(PLACES, score, TargetState(TARGET, (SIZE, SIZE)))
    assert taken[cell((beside, own_y))]
    nearer = np.linalg.norm(PLACES - TARGET, axis=1) < 0.2 * SIZE
    assert not taken[nearer].any()


def test_where_nothing_is_seen_nothing_is_taken(rivals):
    assert not rivals.taken(PLACES, looks(), TargetState(TARGET, (SIZE, SIZE))).any()
