"""The answers to each command of a ground station."""

import math

import pytest
from pymavlink.dialects.v20 import common as mavlink

from helpers.ground_station import (
    ACCEPTED,
    DENIED,
    FAILED,
    IDLE,
    INFORMATION,
    INTERVAL,
    POINT,
    RECTANGLE,
    REQUEST,
    STATUS,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    command_long,
)
from ssiam.web.mavlink.camera import MavlinkCamera
from ssiam.web.types import Add, Remove

NAN = math.nan
WRONG = [
    # name, command, params, result
    ("rectangle of NaN", RECTANGLE, (NAN, 0.1, 0.5, 0.5), DENIED),
    ("rectangle outside", RECTANGLE, (0.1, 0.1, 1.1, 0.5), DENIED),
    ("rectangle below 0", RECTANGLE, (-0.1, 0.1, 0.5, 0.5), DENIED),
    ("rectangle without width", RECTANGLE, (0.5, 0.1, 0.5, 0.5), DENIED),
    ("rectangle upside down", RECTANGLE, (0.1, 0.5, 0.5, 0.1), DENIED),
    ("rectangle without params", RECTANGLE, (), DENIED),
    ("rectangle in pixels", RECTANGLE, (100, 100, 200, 200), DENIED),
    ("point at infinity", POINT, (math.inf, 0.5, 0.1), DENIED),
    ("point with a radius of NaN", POINT, (0.5, 0.5, NAN), DENIED),
    ("point with a radius below 0", POINT, (0.5, 0.5, -0.1), DENIED),
    ("unknown message", REQUEST, (mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION,), DENIED),
    ("message of NaN", REQUEST, (NAN,), DENIED),
    ("interval of another message", INTERVAL, (INFORMATION, 1000), DENIED),
    ("interval of NaN", INTERVAL, (STATUS, NAN), DENIED),
    ("interval below 0", INTERVAL, (STATUS, -2), DENIED),
    ("take off", mavlink.MAV_CMD_NAV_TAKEOFF, (), UNSUPPORTED),
    ("zoom", mavlink.MAV_CMD_SET_CAMERA_ZOOM, (1, 1), UNSUPPORTED),
    ("no such command", 65535, (), UNSUPPORTED),
]


@pytest.mark.parametrize(
    ("command", "params", "result"), [w[1:] for w in WRONG], ids=[w[0] for w in WRONG]
)
def test_an_invalid_command_is_refused_and_has_no_effect(connected, command, params, result):
    session, station = connected
    assert station.ask(command, *params) == result
    assert session.submitted == []


@pytest.mark.parametrize(
    ("code", "result"), [("bad-box", DENIED), ("too-many-targets", FAILED)], ids=str
)
def test_a_refusal_of_the_session_is_answered(connected, code, result):
    session, station = connected
    session.refusal = code
    assert station.ask(RECTANGLE, 0.1, 0.1, 0.2, 0.2) == result
    session.step()
    assert station.ask(REQUEST, STATUS) == ACCEPTED
    assert station.status().tracking_status == IDLE


@pytest.mark.parametrize(
    ("command", "params"),
    [(RECTANGLE, (0.1, 0.1, 0.2, 0.2)), (POINT, (0.5, 0.5, 0.1)), (REQUEST, (STATUS,))],
    ids=["rectangle", "point", "status"],
)
def test_before_the_first_frame_commands_are_rejected(session, station, command, params):
    with MavlinkCamera(session, station.address):
        assert station.ask(command, *params) == TEMPORARILY_REJECTED
        session.step()
        assert station.ask(command, *params) == ACCEPTED


ADDRESSED = [
    # name, (system, component), command, params, result
    ("this camera", (1, 100), RECTANGLE, (0.1, 0.1, 0.2, 0.2), ACCEPTED),
    ("everybody", (0, 0), RECTANGLE, (0.1, 0.1, 0.2, 0.2), ACCEPTED),
    ("all of the system", (1, 0), RECTANGLE, (0.1, 0.1, 0.2, 0.2, 100), ACCEPTED),
    ("another camera of all", (1, 0), RECTANGLE, (0.1, 0.1, 0.2, 0.2, 101), None),
    ("another component", (1, 101), RECTANGLE, (0.1, 0.1, 0.2, 0.2), None),
    ("another system", (2, 100), RECTANGLE, (0.1, 0.1, 0.2, 0.2), None),
    ("everybody, not a camera command", (0, 0), mavlink.MAV_CMD_NAV_TAKEOFF, (), None),
]


@pytest.mark.parametrize(
    ("to", "command", "params", "result"), [a[1:] for a in ADDRESSED], ids=[a[0] for a in ADDRESSED]
)
def test_only_commands_for_this_camera_are_executed(connected, to, command, params, result):
    session, station = connected
    station.send(command_long(command, *params, to=to))
    station.send(command_long(REQUEST, INFORMATION))
    expected = {REQUEST: ACCEPTED} | ({} if result is None else {command: result})
    acks = [station.until("COMMAND_ACK") for _ in expected]
    assert {ack.command: ack.result for ack in acks} == expected
    assert len(session.submitted) == (result == ACCEPTED)


def test_command_int_is_executed_too(connected):
    session, station = connected
    station.send(
        mavlink.MAVLink_command_int_message(
            1, 100, 0, RECTANGLE, 0, 0, 0.25, 0.5, 0.375, 0.75, 0, 0, 0
        )
    )
    assert station.result(RECTANGLE) == ACCEPTED
    assert session.submitted == [Add((160, 180, 80, 90))]


def test_a_repeated_command_is_executed_once(connected):
    session, station = connected
    box = (0.25, 0.5, 0.375, 0.75)
    assert station.ask(RECTANGLE, *box) == ACCEPTED
    assert station.ask(RECTANGLE, *box, confirmation=1) == ACCEPTED
    assert len(session.submitted) == 1
    assert station.ask(RECTANGLE, *box) == ACCEPTED
    assert len(session.submitted) == 3


def test_a_new_target_replaces_the_old_one(connected):
    session, station = connected
    assert station.ask(RECTANGLE, 0.1, 0.1, 0.2, 0.2) == ACCEPTED
    assert station.ask(POINT, 0.5, 0.5, 0.1) == ACCEPTED
    assert [type(command) for command in session.submitted] == [Add, Remove, Add]
    assert set(session.targets) == {2}


def test_commands_while_the_session_is_busy(connected):
    session, station = connected
    session.ready.clear()
    for left in (0.1, 0.2, 0.3):
        station.send(command_long(RECTANGLE, left, 0.1, 0.5, 0.5))
    for _ in range(2):
        station.send(command_long(REQUEST, INFORMATION))
    assert station.until("CAMERA_INFORMATION")  # the camera does not wait for the session
    session.ready.set()
    assert [station.result(RECTANGLE) for _ in range(3)] == [ACCEPTED] * 3
    assert station.ask(REQUEST, INFORMATION) == ACCEPTED
    session.step()
    assert set(session.targets) == {3}
