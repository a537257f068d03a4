"""How often the tracking status is sent."""

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
from ssiam.web.mavlink.camera_service import StatusInterval


def test_the_requested_interval_is_used(connected):
    session, station = connected
    session.set_target(1, (10, 20, 30, 40))

    def received(steps):
        """Number of statuses received for a number of steps."""
        count = 0
        for _ in range(steps):
            session.step()
        station.send(command_long(REQUEST, INFORMATION))
        while (message := station.receive()).get_type() != "CAMERA_INFORMATION":
            count += message.get_type() == "CAMERA_TRACKING_IMAGE_STATUS"
        return count

    assert station.ask(INTERVAL, STATUS, -1) == ACCEPTED
    assert received(20) == 0
    assert station.ask(REQUEST, STATUS) == ACCEPTED
    assert station.status().tracking_status == ACTIVE
    assert station.ask(INTERVAL, STATUS, 3600e6) == ACCEPTED
    received(1)
    assert received(20) == 0
    assert station.ask(INTERVAL, STATUS, 0) == ACCEPTED
    for _ in range(5):
        session.step()
        assert station.status().tracking_status == ACTIVE


INTERVALS = [
    # name, microseconds, statuses in ten seconds with thirty steps each
    ("every step", 0, 300),
    ("ten a second", 100_000, 100),
    ("eleven a second", 90_000, 111),
    ("more than there are", 1000, 300),
    ("every second", 1e6, 10),
    ("never", -1, 0),
]


@pytest.mark.parametrize(
    ("microseconds", "count"), [i[1:] for i in INTERVALS], ids=[i[0] for i in INTERVALS]
)
def test_the_interval_is_met_on_average(microseconds, count):
    seconds = iter(range(300))
    interval = StatusInterval(lambda: next(seconds) / 30)
    assert interval.set(microseconds)
    assert sum(interval.is_due(ACTIVE) for _ in range(300)) == pytest.approx(count, rel=0.01)


def test_without_a_target_the_status_is_sent_once_per_second():
    seconds = iter(range(300))
    interval = StatusInterval(lambda: next(seconds) / 30)
    assert sum(interval.is_due(IDLE) for _ in range(270)) == 9
    assert [interval.is_due(status) for status in (ACTIVE, ACTIVE, IDLE)] == [True] * 3
