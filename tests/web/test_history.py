import numpy as np
import pytest

from ssiam.geometry import IDENTITY
from ssiam.video import Frame
from ssiam.web.history import StepHistory
from ssiam.web.types import CommandError, Step

SMALL, LARGE = np.zeros((4, 4, 3), np.uint8), np.zeros((1080, 1920, 3), np.uint8)


def step(number, *, image=SMALL, index=None, rate=30):
    frame = Frame(number if index is None else index, number / rate, image)
    done = number / rate
    return Step(number, frame, (), None, IDENTITY, "off", done, done, rate, 0, "playing")


def numbers(history, number):
    return [each.number for each in history.since(number)]


def filled(count, **options):
    history = StepHistory()
    for number in range(1, count + 1):
        history.append(step(number, **options))
    return history


def test_steps_of_the_last_second_are_kept():
    history = filled(100)
    assert numbers(history, 95) == [95, 96, 97, 98, 99, 100]
    with pytest.raises(CommandError, match="step 40 is no longer available") as caught:
        history.since(40)
    assert caught.value.code == "too-old"


def test_none_stands_for_the_newest_step():
    assert numbers(filled(7), None) == [7]


@pytest.mark.parametrize("number", [None, 1], ids=["newest", "a number"])
def test_before_the_first_frame_no_step_is_available(number):
    with pytest.raises(CommandError):
        StepHistory().since(number)


def test_a_held_step_is_kept_until_it_is_used():
    history = filled(10)
    history.hold(8)
    for number in range(11, 400):
        history.append(step(number))
    assert numbers(history, 8)[0] == 8
    history.append(step(400))
    with pytest.raises(CommandError):
        history.since(8)


def test_a_hold_expires():
    history = filled(10)
    history.hold(8)
    history.append(step(11))
    history.append(step(30 * 120))
    history.append(step(30 * 120 + 1))
    with pytest.raises(CommandError):
        history.since(8)


def test_a_long_history_is_sampled():
    history = filled(5)
    history.hold(3)
    for number in range(6, 300):
        history.append(step(number))
    chosen = numbers(history, 3)
    assert len(chosen) == 24
    assert (chosen[0], chosen[-1]) == (3, 299)
    assert chosen == sorted(set(chosen))


def test_of_large_images_fewer_are_kept():
    history = filled(3, image=LARGE)
    history.hold(2)
    for number in range(4, 90):
        history.append(step(number, image=LARGE))
    chosen = numbers(history, 2)
    assert (chosen[0], chosen[-1]) == (2, 89)
    assert 2 < len(chosen) <= 96 * 2**20 // LARGE.nbytes + 1


def test_a_repeated_frame_is_used_once():
    history = StepHistory()
    frame = Frame(0, 0.0, SMALL)
    for number in (1, 2, 3):
        history.append(Step(number, frame, (), None, IDENTITY, "off", 0, 0, 30, 0, "paused"))
    history.append(step(4, index=1))
    assert numbers(history, 1) == [1, 4]


def test_the_number_of_holds_is_limited():
    history = filled(30)
    for number in range(1, 31):
        history.hold(number)
    for number in range(31, 200):
        history.append(step(number))
    with pytest.raises(CommandError):
        history.since(5)
    assert numbers(history, 20)[0] == 20
