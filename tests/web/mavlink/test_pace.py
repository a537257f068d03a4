"""How often the status is told."""

import pytest

from helpers.ground_station import (
    ACCEPTED,
    ACTIVE,
    IDLE,
    INFORMATION,
    INTERVAL,
    REQUEST,
    STATUS,
    command_long,
)
from ssiam.web.mavlink.pace import Pace


def test_the_status_comes_as_often_as_was_asked_for(flying):
    session, station = flying
    session.draw(1, (10, 20, 30, 40))

    def told(steps):
        """How many statuses come with as many steps."""
        numbers = 0
        for _ in range(steps):
            session.step()
        station.send(command_long(REQUEST, INFORMATION))
        while (message := station.receive()).get_type() != "CAMERA_INFORMATION":
            numbers += message.get_type() == "CAMERA_TRACKING_IMAGE_STATUS"
        return numbers

    assert station.ask(INTERVAL, STATUS, -1) == ACCEPTED
    assert told(20) == 0
    assert station.ask(REQUEST, STATUS) == ACCEPTED
    assert station.status().tracking_status == ACTIVE
    assert station.ask(INTERVAL, STATUS, 3600e6) == ACCEPTED
    told(1)
    assert told(20) == 0
    assert station.ask(INTERVAL, STATUS, 0) == ACCEPTED
    for _ in range(5):
        session.step()
        assert station.status().tracking_status == ACTIVE


PACES = [
    # name, microseconds asked for, statuses in ten seconds of thirty steps each
    ("every step", 0, 300),
    ("ten a second", 100_000, 100),
    ("eleven a second", 90_000, 111),
    ("more than there are", 1000, 300),
    ("every second", 1e6, 10),
    ("never", -1, 0),
]


@pytest.mark.parametrize(("asked", "count"), [p[1:] for p in PACES], ids=[p[0] for p in PACES])
def test_an_interval_is_kept_on_average(asked, count):
    seconds = iter(range(300))
    pace = Pace(lambda: next(seconds) / 30)
    assert pace.ask(asked)
    assert sum(pace.is_due(ACTIVE) for _ in range(300)) == pytest.approx(count, rel=0.01)


def test_while_there_is_nothing_to_tell_it_is_told_once_a_second():
    seconds = iter(range(300))
    pace = Pace(lambda: next(seconds) / 30)
    assert sum(pace.is_due(IDLE) for _ in range(270)) == 9
    assert [pace.is_due(status) for status in (ACTIVE, ACTIVE, IDLE)] == [True] * 3
