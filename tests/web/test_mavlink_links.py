"""The MAVLink camera on links of all kinds, with noise and floods on them."""

import os
import random
import re
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress

import pytest
from ground_station import HERE, SECONDS, GroundStation, command_long, free_port
from pymavlink.dialects.v20 import common as mavlink
from scripted_session import ScriptedSession

from ssiam.errors import ArgumentError
from ssiam.web.mavlink.camera import MavlinkCamera
from ssiam.web.mavlink.ports import StreamLink

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
RECTANGLE, REQUEST = mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE, mavlink.MAV_CMD_REQUEST_MESSAGE
INFORMATION = mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION
IDLE = mavlink.CAMERA_TRACKING_STATUS_FLAGS_IDLE


@pytest.fixture
def session():
    with ScriptedSession() as session:
        yield session


@pytest.fixture
def station():
    with GroundStation() as station:
        yield station


def _noise(chance, packet):
    """Random bytes, or a packet with something wrong in it."""
    kind = chance.randrange(4)
    if kind == 0:
        return chance.randbytes(chance.randrange(1, 300))
    if kind == 1:
        return packet[: chance.randrange(len(packet))]
    if kind == 2:
        return bytes([chance.choice((0xFD, 0xFE))]) * chance.randrange(1, 300)
    place = chance.randrange(len(packet))
    return packet[:place] + bytes([packet[place] ^ chance.randrange(1, 256)]) + packet[place + 1 :]


@pytest.mark.parametrize("kind", ["udpout", "udpin"])
def test_noise_on_the_port_does_no_harm(session, station, kind):
    if kind == "udpin":
        port = free_port()
        station.address, station.peer = f"udpin:{HERE}:{port}", (HERE, port)
    chance = random.Random(5)
    packet = bytes(command_long(RECTANGLE, 0.1, 0.1, 0.2, 0.2).pack(station.mavlink))
    with MavlinkCamera(session, station.address):
        session.step()
        for _ in range(400):
            station.send_bytes(_noise(chance, packet))
        assert session.asked == []
        answers = [station.ask(RECTANGLE, 0.1, 0.1, 0.2, 0.2, seconds=2) for _ in range(2)]
    assert ACCEPTED in answers


def test_a_flood_of_commands_is_not_carried_out(session, station):
    with MavlinkCamera(session, station.address):
        for _ in range(200):
            station.send(command_long(REQUEST, INFORMATION))
        answered = 0
        while message := station.receive(0.5):
            answered += message.get_type() == "CAMERA_INFORMATION"
        assert 20 <= answered <= 40  # within two seconds at the most
        time.sleep(0.6)
        assert station.ask(REQUEST, INFORMATION) == ACCEPTED


def test_whoever_sends_to_the_port_is_answered(session):
    port = free_port()
    stations = [GroundStation((HERE, port)) for _ in range(2)]
    with MavlinkCamera(session, f"udpin:{HERE}:{port}"), stations[0], stations[1]:
        for station in stations:
            assert station.ask(REQUEST, INFORMATION) == ACCEPTED
        session.step()
        for station in stations:
            assert station.status().tracking_status == IDLE


WRONG_ADDRESSES = [
    ("nothing", "", "use udpout:HOST:PORT"),
    ("no such kind", "pigeon:1.2.3.4:5", "use udpout:HOST:PORT"),
    ("no port", "udpout:127.0.0.1", "host and a port"),
    ("a word for a port", "udpin:127.0.0.1:mavlink", "host and a port"),
    ("too high a port", "tcp:127.0.0.1:65536", "host and a port"),
    ("no host", "tcp::5760", "host and a port"),
    ("no such host", "udpout:nowhere.invalid:14550", "cannot be used"),
    ("a foreign address", "udpin:192.0.2.1:14550", "cannot be used"),
    ("no such device", "/dev/ttyUSB77,57600", "use udpout:HOST:PORT"),
    ("no serial port", "/dev/null", "no serial port"),
    ("a word for a baud rate", "/dev/null,fast", "no baud rate"),
]


@pytest.mark.parametrize(
    ("address", "words"), [w[1:] for w in WRONG_ADDRESSES], ids=[w[0] for w in WRONG_ADDRESSES]
)
def test_an_address_that_cannot_be_used_is_named_in_one_line(session, address, words):
    with pytest.raises(ArgumentError, match=re.escape(words)) as caught:
        MavlinkCamera(session, address)
    assert address in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_port_that_is_taken_is_named(session, station):
    taken = station.address.replace("udpout", "udpin")
    with pytest.raises(ArgumentError, match="in use"):
        MavlinkCamera(session, taken)


@pytest.mark.parametrize("system", [0, 256, -1])
def test_a_system_out_of_range_is_named(session, station, system):
    with pytest.raises(ArgumentError, match=f"system {system}"):
        MavlinkCamera(session, station.address, system=system)


def _heard(read, name):
    """The next message of that name in a stream of bytes, cut at odd places."""
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        for message in parser.parse_buffer(read()) or ():
            if message.get_type() == name:
                return message
    raise AssertionError(f"no {name}")


def test_tcp_is_connected_again_after_it_broke(session):
    with socket.create_server((HERE, 0)) as server:
        port = server.getsockname()[1]
        with MavlinkCamera(session, f"tcp:{HERE}:{port}"):
            for _ in range(2):
                connection, _ = server.accept()
                with connection:
                    assert _heard(lambda c=connection: c.recv(7), "HEARTBEAT")
                    packet = command_long(REQUEST, INFORMATION).pack(mavlink.MAVLink(None))
                    for byte in b"noise\xfe\xfd\xfd" + bytes(packet):
                        connection.sendall(bytes([byte]))
                    assert _heard(lambda c=connection: c.recv(7), "CAMERA_INFORMATION")


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_a_serial_port_carries_it_too(session):
    ours, theirs = os.openpty()
    try:
        with MavlinkCamera(session, f"{os.ttyname(theirs)},57600"):
            assert _heard(lambda: os.read(ours, 64), "HEARTBEAT")
            os.write(ours, bytes(command_long(REQUEST, INFORMATION).pack(mavlink.MAVLink(None))))
            assert _heard(lambda: os.read(ours, 64), "CAMERA_INFORMATION")
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_stream_that_nobody_reads_drops_whole_frames():
    ours, theirs = socket.socketpair()
    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    theirs.setblocking(False)
    link = StreamLink("pair", lambda: theirs)
    assert link.read(0) == b""
    for number in range(100):
        link.write(b"<%06d%s>" % (number, b"." * 12000))
    data = b""
    ours.settimeout(0.1)
    with suppress(TimeoutError):
        while True:
            data += ours.recv(4096)
            link.write(b"")  # what is left of a frame goes first
    link.close()
    ours.close()
    frames = re.findall(rb"<(\d{6})\.{12000}>", data)
    assert len(data) == 12008 * len(frames)
    assert 0 < len(frames) < 100


def test_closing_ends_the_threads_and_may_be_done_twice(session, station):
    camera = MavlinkCamera(session, station.address)
    camera.close()
    camera.close()
    assert not [t for t in threading.enumerate() if t.name.startswith("ssiam-mavlink")]
    session.step()


_WITHOUT = """
import sys
sys.modules["pymavlink"] = None
import ssiam.web.mavlink.camera
"""
_ENVIRONMENT = """
import os
before = {name for name in os.environ if "MAVLINK" in name}
import ssiam.web.mavlink.camera
assert {name for name in os.environ if "MAVLINK" in name} == before
"""


def test_without_pymavlink_it_says_what_to_install():
    done = subprocess.run([sys.executable, "-c", _WITHOUT], capture_output=True, text=True)
    assert "MissingExtraError" in done.stderr.splitlines()[-1]
    assert "pip install 'ssiam[mavlink]'" in done.stderr


def test_the_environment_is_left_as_it_is():
    subprocess.run([sys.executable, "-c", _ENVIRONMENT], check=True)
