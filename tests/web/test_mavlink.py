"""A ground station on the other end of a real link: what it begins, and what it is told."""

import math
import re
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from ground_station import HERE, SECONDS, GroundStation, command_long, free_port
from pymavlink.dialects.v20 import common as mavlink
from scripted_session import SIZE, ScriptedSession
from shaky_clip import write_clip

import ssiam
from ssiam.web.commands import Add, Remove
from ssiam.web.feeds.feed import open_feed
from ssiam.web.mavlink.camera import MavlinkCamera
from ssiam.web.mavlink.pace import Pace
from ssiam.web.recording import Recordings
from ssiam.web.session import Session

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
RECTANGLE, POINT = mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE, mavlink.MAV_CMD_CAMERA_TRACK_POINT
STOP, INTERVAL = mavlink.MAV_CMD_CAMERA_STOP_TRACKING, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
STATUS = mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS
INFORMATION = mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION
IDLE, ACTIVE, ERROR = 0, 1, 2
IN_STATUS = mavlink.CAMERA_TRACKING_TARGET_DATA_IN_STATUS
DOCUMENT = Path(__file__).parents[2] / "docs" / "mavlink.md"


@pytest.fixture
def session():
    with ScriptedSession() as session:
        yield session


@pytest.fixture
def station():
    with GroundStation() as station:
        yield station


@pytest.fixture
def flying(session, station):
    """A session with one step, watched by a station."""
    with MavlinkCamera(session, station.address):
        session.step()
        assert station.status().tracking_status == IDLE
        yield session, station


def rectangle(status):
    """(x, y, w, h) in pixels."""
    (left, right), (top, bottom) = (
        [share * size for share in shares]
        for shares, size in zip(
            [(status.rec_top_x, status.rec_bottom_x), (status.rec_top_y, status.rec_bottom_y)],
            SIZE,
            strict=True,
        )
    )
    return pytest.approx((left, top, right - left, bottom - top), abs=1e-3)


def test_heartbeats_of_a_camera(session, station):
    with MavlinkCamera(session, station.address, system=7):
        beats = [station.until("HEARTBEAT") for _ in range(2)]
    for beat in beats:
        assert (beat.get_srcSystem(), beat.get_srcComponent()) == (7, mavlink.MAV_COMP_ID_CAMERA)
        assert beat.type == mavlink.MAV_TYPE_CAMERA
        assert beat.autopilot == mavlink.MAV_AUTOPILOT_INVALID
        assert beat.get_msgbuf()[0] == 0xFD  # MAVLink 2


ASKED_ABOUT = [
    ("by its number", REQUEST, (INFORMATION,)),
    ("as of old", mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION, (1,)),
]


@pytest.mark.parametrize(
    ("command", "params"), [a[1:] for a in ASKED_ABOUT], ids=[a[0] for a in ASKED_ABOUT]
)
def test_information_tells_size_name_and_what_it_can(flying, command, params):
    _, station = flying
    assert station.ask(command, *params) == ACCEPTED
    told = station.until("CAMERA_INFORMATION")
    assert (told.resolution_h, told.resolution_v) == SIZE
    assert bytes(told.vendor_name).rstrip(b"\0") == bytes(told.model_name).rstrip(b"\0") == b"ssiam"
    assert told.flags == (
        mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_POINT
        | mavlink.CAMERA_CAP_FLAGS_HAS_TRACKING_RECTANGLE
    )
    assert math.isnan(told.focal_length)


def test_information_before_the_first_frame_has_no_size(session, station):
    with MavlinkCamera(session, station.address):
        assert station.ask(REQUEST, INFORMATION) == ACCEPTED
        told = station.until("CAMERA_INFORMATION")
    assert (told.resolution_h, told.resolution_v) == (0, 0)


def test_settings_say_that_it_takes_video(flying):
    _, station = flying
    assert station.ask(REQUEST, mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS) == ACCEPTED
    assert station.until("CAMERA_SETTINGS").mode_id == mavlink.CAMERA_MODE_VIDEO


def test_a_rectangle_is_followed_and_every_step_is_told(flying):
    session, station = flying
    assert station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75) == ACCEPTED
    assert session.asked == [Add((160, 180, 80, 90))]
    for shift in range(20):
        box = (160 + 7.5 * shift, 180 - 3.25 * shift, 80 + shift, 90)
        session.draw(1, box)
        session.step()
        status = station.status()
        assert status.tracking_status == ACTIVE
        assert status.tracking_mode == mavlink.CAMERA_TRACKING_MODE_RECTANGLE
        assert status.target_data == IN_STATUS
        assert rectangle(status) == box
        centre = status.point_x * SIZE[0], status.point_y * SIZE[1]
        assert centre == pytest.approx((box[0] + box[2] / 2, box[1] + box[3] / 2), abs=1e-3)
        assert math.isnan(status.radius)


def test_a_box_that_leaves_the_picture_is_told_as_far_as_it_is_in_it(flying):
    session, station = flying
    session.draw(1, (-20, 300, 80, 90))
    session.step()
    assert rectangle(station.status(lambda s: s.tracking_status)) == (0, 300, 60, 60)


POINTS = [
    # name, x, y, radius, the box in pixels
    ("in the middle", 0.5, 0.5, 0.1, (256, 116, 128, 128)),
    ("without a size", 0.5, 0.5, 0, (304, 164, 32, 32)),
    ("at the edge", 0, 1, 0.1, (0, 296, 64, 64)),
]


@pytest.mark.parametrize(
    ("x", "y", "radius", "box"), [p[1:] for p in POINTS], ids=[p[0] for p in POINTS]
)
def test_a_point_is_followed_as_the_square_around_it(flying, x, y, radius, box):
    session, station = flying
    assert station.ask(POINT, x, y, radius) == ACCEPTED
    assert session.asked[0].xywh == pytest.approx(box, abs=1e-4)
    session.step()
    status = station.status()
    assert (status.tracking_status, status.tracking_mode) == (ACTIVE, 1)
    assert status.point_x == pytest.approx((box[0] + box[2] / 2) / SIZE[0])
    assert status.point_y == pytest.approx((box[1] + box[3] / 2) / SIZE[1])
    assert status.radius == pytest.approx(box[2] / 2 / SIZE[0])


def test_a_lost_target_is_an_error_without_a_place(flying):
    session, station = flying
    station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75)
    session.draw(1, (1, 2, 30, 40), lost=True)
    session.step()
    status = station.status()
    assert (status.tracking_status, status.target_data) == (ERROR, 0)
    assert math.isnan(status.point_x)
    assert math.isnan(status.rec_top_x)
    session.draw(1, (1, 2, 30, 40))
    session.step()
    assert station.status().tracking_status == ACTIVE


def test_stopping_removes_the_target_and_is_told(flying):
    session, station = flying
    station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75)
    session.step()
    assert station.status().tracking_status == ACTIVE
    assert station.ask(STOP) == ACCEPTED
    assert session.asked[1:] == [Remove(1)]
    session.step()
    status = station.status()
    assert (status.tracking_status, status.tracking_mode, status.target_data) == (IDLE, 0, 0)
    assert station.ask(STOP) == ACCEPTED
    assert len(session.asked) == 2


def test_targets_of_others_are_left_alone_and_told_of(flying):
    session, station = flying
    session.draw(1, (10, 20, 30, 40))
    session.step()
    assert rectangle(station.status()) == (10, 20, 30, 40)
    assert station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75) == ACCEPTED
    session.step()
    assert rectangle(station.status()) == (160, 180, 80, 90)
    assert station.ask(STOP) == ACCEPTED
    session.step()
    assert rectangle(station.status()) == (10, 20, 30, 40)
    assert set(session.targets) == {1}


def test_a_target_that_somebody_else_removed_can_be_stopped(flying):
    session, station = flying
    station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75)
    session.step()
    assert station.status().tracking_status == ACTIVE
    session.submit(Remove(1)).result(SECONDS)
    session.step()
    assert station.status().tracking_status == IDLE
    assert station.ask(STOP) == ACCEPTED


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


@contextmanager
def running(path, address):
    """A real session on a clip at its own pace, as a camera."""
    feed = open_feed(str(path), pace="source", notes=lambda note: None)
    session = Session(feed, ssiam.load_tracker("csrt"), "csrt", Recordings())
    steps = []
    session.listen(steps.append)
    with session, MavlinkCamera(session, address):
        yield steps


def test_a_real_session_is_led_by_a_ground_station(tmp_path, station):
    boxes = write_clip(tmp_path / "clip.mp4", 120, fps=20)
    x, y, w, h = boxes[0]
    with running(tmp_path / "clip.mp4", station.address) as steps:
        station.status()
        x, y, w, h = boxes[steps[-1].frame.index]
        corners = x / 320, y / 240, (x + w) / 320, (y + h) / 240
        assert station.ask(RECTANGLE, *corners) == ACCEPTED
        told = [station.status(lambda s: s.tracking_status == ACTIVE) for _ in range(20)]
        assert station.ask(STOP) == ACCEPTED
        assert station.status(lambda s: s.tracking_status == IDLE)
    seen = [
        tuple(
            side / size
            for side, size in zip(step.targets[0].track.box, (320, 240) * 2, strict=True)
        )
        for step in steps
        if step.targets
    ]
    for status in told:
        left, top = status.rec_top_x, status.rec_top_y
        box = (left, top, status.rec_bottom_x - left, status.rec_bottom_y - top)
        assert box in [pytest.approx(each, abs=1e-4) for each in seen]
    assert not steps[-1].targets


def test_the_script_of_the_document_follows_a_target(tmp_path):
    (script,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    port = free_port()
    assert "14550" in script
    script = script.replace("14550", str(port))
    write_clip(tmp_path / "clip.mp4", 150, fps=20)
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", script], stdout=subprocess.PIPE, text=True
    )
    with process, running(tmp_path / "clip.mp4", f"udpout:{HERE}:{port}"):
        lines = [process.stdout.readline() for _ in range(3)]
        process.kill()
    assert lines[0].strip() == "0"  # MAV_RESULT_ACCEPTED
    for line in lines[1:]:
        assert re.fullmatch(r"1 0\.\d+ 0\.\d+ 0\.\d+ 0\.\d+", line.strip())
