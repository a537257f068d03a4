"""Heartbeats, information and settings of the camera."""

import math

import pytest
from pymavlink.dialects.v20 import common as mavlink

from helpers.ground_station import ACCEPTED, INFORMATION, REQUEST
from helpers.scripted_session import SIZE
from ssiam.web.mavlink.camera import MavlinkCamera


def test_heartbeats_of_a_camera(session, station):
    with MavlinkCamera(session, station.address, system=7):
        beats = [station.until("HEARTBEAT") for _ in range(2)]
    for beat in beats:
        assert (beat.get_srcSystem(), beat.get_srcComponent()) == (7, mavlink.MAV_COMP_ID_CAMERA)
        assert beat.type == mavlink.MAV_TYPE_CAMERA
        assert beat.autopilot == mavlink.MAV_AUTOPILOT_INVALID
        assert beat.get_msgbuf()[0] == 0xFD  # MAVLink 2


REQUESTS = [
    ("by message id", REQUEST, (INFORMATION,)),
    ("deprecated command", mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION, (1,)),
]


@pytest.mark.parametrize(
    ("command", "params"), [r[1:] for r in REQUESTS], ids=[r[0] for r in REQUESTS]
)
def test_information_has_size_name_and_capabilities(connected, command, params):
    _, station = connected
    assert station.ask(command, *params) == ACCEPTED
    info = station.until("CAMERA_INFORMATION")
    assert (info.resolution_h, info.resolution_v) == SIZE
    assert bytes(info.vendor_name).rstrip(b"\0") == bytes(info.model_name).rstrip(b"\0") == b"ssiam"
    assert info.flags == (
        mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_POINT
        | mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_RECTANGLE
    )
    assert math.isnan(info.focal_length)


def test_information_before_the_first_frame_has_no_size(session, station):
    with MavlinkCamera(session, station.address):
        assert station.ask(REQUEST, INFORMATION) == ACCEPTED
        info = station.until("CAMERA_INFORMATION")
    assert (info.resolution_h, info.resolution_v) == (0, 0)


def test_the_mode_is_video(connected):
    _, station = connected
    assert station.ask(REQUEST, mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS) == ACCEPTED
    assert station.until("CAMERA_SETTINGS").mode_id == mavlink.CAMERA_MODE_VIDEO
