import numpy as np
import pytest

from ssiam.geometry import IDENTITY
from ssiam.video import Frame
from ssiam.web.errors import CommandError
from ssiam.web.past import Past
from ssiam.web.step import Step

SMALL, LARGE = np.zeros((4, 4, 3), np.uint8), np.zeros((1080, 1920, 3), np.uint8)


def step(number, *, image=SMALL, index=None, rate=30):
    frame = Frame(number if index is None else index, number / rate, image)
    done = number / rate
    return Step(number, frame, (), None, IDENTITY, "off", done, done, rate, 0, "playing")


def numbers(past, number):
    return [each.number for each in past.since(number)]


def filled(count, **options):
    past = Past()
    for number in range(1, count + 1):
        past.keep(step(number, **options))
    return past


def test_a_moment_is_kept_and_what_is_older_let_go():
    past = filled(100)
    assert numbers(past, 95) == [95, 96, 97, 98, 99, 100]
    with pytest.raises(CommandError, match="step 40 is no longer there") as caught:
        past.since(40)
    assert caught.value.code == "too-old"


def test_none_is_the_newest_step():
    assert numbers(filled(7), None) == [7]


@pytest.mark.parametrize("number", [None, 1], ids=["newest", "a number"])
def test_before_the_first_frame_there_is_nothing(number):
    with pytest.raises(CommandError):
        Past().since(number)


def test_a_held_step_is_kept_until_the_box_comes():
    past = filled(10)
    past.hold(8)
    for number in range(11, 400):
        past.keep(step(number))
    assert numbers(past, 8)[0] == 8
    past.keep(step(400))
    with pytest.raises(CommandError):
        past.since(8)


def test_nobody_holds_a_step_for_ever():
    past = filled(10)
    past.hold(8)
    past.keep(step(11))
    past.keep(step(30 * 120))
    past.keep(step(30 * 120 + 1))
    with pytest.raises(CommandError):
        past.since(8)


def test_a_long_way_is_caught_up_in_few_steps():
    past = filled(5)
    past.hold(3)
    for number in range(6, 300):
        past.keep(step(number))
    caught = numbers(past, 3)
    assert len(caught) == 24
    assert (caught[0], caught[-1]) == (3, 299)
    assert caught == sorted(set(caught))


def test_large_pictures_are_kept_more_thinly():
    past = filled(3, image=LARGE)
    past.hold(2)
    for number in range(4, 90):
        past.keep(step(number, image=LARGE))
    caught = numbers(past, 2)
    assert (caught[0], caught[-1]) == (2, 89)
    assert 2 < len(caught) <= 96 * 2**20 // LARGE.nbytes + 1


def test_a_frame_that_was_told_of_twice_is_looked_at_once():
    past = Past()
    frame = Frame(0, 0.0, SMALL)
    for number in (1, 2, 3):
        past.keep(Step(number, frame, (), None, IDENTITY, "off", 0, 0, 30, 0, "paused"))
    past.keep(step(4, index=1))
    assert numbers(past, 1) == [1, 4]


def test_nobody_can_hold_everything():
    past = filled(30)
    for number in range(1, 31):
        past.hold(number)
    for number in range(31, 200):
        past.keep(step(number))
    with pytest.raises(CommandError):
        past.since(5)
    assert numbers(past, 20)[0] == 20
