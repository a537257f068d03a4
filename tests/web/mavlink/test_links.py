"""The camera on links of all kinds, with noise and floods."""

import os
import random
import re
import socket
import sys
import threading
import time
from contextlib import suppress

import pytest
from pymavlink.dialects.v20 import common as mavlink

from helpers.ground_station import (
    ACCEPTED,
    HERE,
    IDLE,
    INFORMATION,
    RECTANGLE,
    REQUEST,
    SECONDS,
    GroundStation,
    command_long,
    free_port,
)
from ssiam.web.mavlink.camera import MavlinkCamera
from ssiam.web.mavlink.links import StreamLink


def _noise(chance, packet):
    """Random bytes, or a damaged packet."""
    kind = chance.randrange(4)
    if kind == 0:
        return chance.randbytes(chance.randrange(1, 300))
    if kind == 1:
        return packet[: chance.randrange(len(packet))]
    if kind == 2:
        return bytes([chance.choice((0xFD, 0xFE))]) * chance.randrange(1, 300)
    index = chance.randrange(len(packet))
    return packet[:index] + bytes([packet[index] ^ chance.randrange(1, 256)]) + packet[index + 1 :]


@pytest.mark.parametrize("kind", ["udpout", "udpin"])
def test_noise_on_the_port_has_no_effect(session, station, kind):
    if kind == "udpin":
        port = free_port()
        station.address, station.peer = f"udpin:{HERE}:{port}", (HERE, port)
    chance = random.Random(5)
    packet = bytes(command_long(RECTANGLE, 0.1, 0.1, 0.2, 0.2).pack(station.mavlink))
    with MavlinkCamera(session, station.address):
        session.step()
        for _ in range(400):
            station.send_bytes(_noise(chance, packet))
        assert session.submitted == []
        answers = [station.ask(RECTANGLE, 0.1, 0.1, 0.2, 0.2, seconds=2) for _ in range(2)]
    assert ACCEPTED in answers


def test_a_flood_of_commands_is_limited(session, station):
    with MavlinkCamera(session, station.address):
        for _ in range(200):
            station.send(command_long(REQUEST, INFORMATION))
        answered = 0
        while message := station.receive(0.5):
            answered += message.get_type() == "CAMERA_INFORMATION"
        assert 20 <= answered <= 40  # within at most two seconds
        time.sleep(0.6)
        assert station.ask(REQUEST, INFORMATION) == ACCEPTED


def test_commands_of_others_to_a_udpout_link_are_ignored(session, station):
    with MavlinkCamera(session, station.address), GroundStation() as stranger:
        session.step()
        assert station.receive()
        stranger.peer = station.peer
        for _ in range(5):
            stranger.send(command_long(RECTANGLE, 0.1, 0.1, 0.2, 0.2))
        assert station.ask(REQUEST, INFORMATION) == ACCEPTED
        assert session.submitted == []
        assert stranger.receive(0.2) is None


def test_all_senders_to_a_udpin_port_are_answered(session):
    port = free_port()
    stations = [GroundStation((HERE, port)) for _ in range(2)]
    with MavlinkCamera(session, f"udpin:{HERE}:{port}"), stations[0], stations[1]:
        for station in stations:
            assert station.ask(REQUEST, INFORMATION) == ACCEPTED
        session.step()
        for station in stations:
            assert station.status().tracking_status == IDLE


def _received(read, name):
    """The next message of this type in a stream of bytes that is read in small chunks."""
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        for message in parser.parse_buffer(read()) or ():
            if message.get_type() == name:
                return message
    raise AssertionError(f"no {name}")


def test_tcp_reconnects(session):
    with socket.create_server((HERE, 0)) as server:
        port = server.getsockname()[1]
        with MavlinkCamera(session, f"tcp:{HERE}:{port}"):
            for _ in range(2):
                connection, _ = server.accept()
                with connection:
                    assert _received(lambda c=connection: c.recv(7), "HEARTBEAT")
                    packet = command_long(REQUEST, INFORMATION).pack(mavlink.MAVLink(None))
                    for byte in b"noise\xfe\xfd\xfd" + bytes(packet):
                        connection.sendall(bytes([byte]))
                    assert _received(lambda c=connection: c.recv(7), "CAMERA_INFORMATION")


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_a_serial_port(session):
    ours, theirs = os.openpty()
    try:
        with MavlinkCamera(session, f"{os.ttyname(theirs)},57600"):
            assert _received(lambda: os.read(ours, 64), "HEARTBEAT")
            os.write(ours, bytes(command_long(REQUEST, INFORMATION).pack(mavlink.MAVLink(None))))
            assert _received(lambda: os.read(ours, 64), "CAMERA_INFORMATION")
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_full_stream_drops_whole_frames():
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
            link.write(b"")  # sends the rest of a frame
    link.close()
    ours.close()
    frames = re.findall(rb"<(\d{6})\.{12000}>", data)
    assert len(data) == 12008 * len(frames)
    assert 0 < len(frames) < 100


def test_close_ends_the_threads_and_may_be_called_twice(session, station):
    camera = MavlinkCamera(session, station.address)
    camera.close()
    camera.close()
    assert not [t for t in threading.enumerate() if t.name.startswith("ssiam-mavlink")]
    session.step()
