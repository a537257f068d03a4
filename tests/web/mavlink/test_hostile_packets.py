"""No packet, however malformed, stops the camera or its session."""

import math
import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

import ssiam
from helpers.ground_station import ACCEPTED, DENIED, FAILED, POINT, RECTANGLE, STOP, command_long
from helpers.shaky_clip import write_clip
from ssiam.web.feeds.opening import open_feed
from ssiam.web.mavlink.camera import MavlinkCamera
from ssiam.web.mavlink.commands import CommandReader
from ssiam.web.recording import Recordings
from ssiam.web.session import Session

PACKETS = 1000


def packed(message):
    return bytes(message.pack(mavlink.MAVLink(None, srcSystem=255, srcComponent=190)))


def random_frame(r):
    """A complete frame of a random message with random content and a valid checksum."""
    number = int(r.choice(list(mavlink.mavlink_map)))
    kind = mavlink.mavlink_map[number]
    payload = r.bytes(int(r.integers(1, struct.calcsize(kind.unpacker.format) + 1)))
    head = bytes([0xFD, len(payload), 0, 0, 0, 255, 190]) + number.to_bytes(3, "little")
    crc = mavlink.x25crc(head[1:] + payload)
    crc.accumulate(bytes([kind.crc_extra]))
    return head + payload + struct.pack("<H", crc.crc)


def test_a_valid_command_is_read_after_every_hostile_packet():
    r, reader = np.random.default_rng(2), CommandReader(1, 100)
    good = packed(command_long(STOP, 0, 0))
    for _ in range(PACKETS):
        list(reader.commands(random_frame(r), is_complete=True))
        assert [received.command for received in reader.commands(good, is_complete=True)] == [STOP]


def test_a_frame_that_the_decoder_raises_on_is_dropped(monkeypatch):
    reader = CommandReader(1, 100)
    good = packed(command_long(STOP, 0, 0))
    original = reader._mavlink.decode

    def failing(frame):
        if frame[4] != 1:
            raise struct.error("bad char in struct format")
        return original(frame)

    monkeypatch.setattr(reader._mavlink, "decode", failing)
    bad = bytearray(good)
    bad[4] = 9
    for _ in range(3):
        assert list(reader.commands(bytes(bad), is_complete=True)) == []
    bad[4] = 1
    assert len(list(reader.commands(bytes(bad), is_complete=True))) in (0, 1)
    assert not reader._buffer


@pytest.mark.parametrize("tracker", ["csrt", "mil"])
def test_every_box_is_answered_and_the_next_one_tracked(tmp_path, station, tracker):
    boxes = write_clip(tmp_path / "clip.mp4", 20)
    feed = open_feed(str(tmp_path / "clip.mp4"), notify=lambda note: None)
    session = Session(feed, ssiam.load_tracker(tracker), tracker, Recordings())
    x, y, w, h = boxes[-1]
    good = x / 320, y / 240, (x + w) / 320, (y + h) / 240
    thin = [
        (RECTANGLE, (0.1, 0.2, 0.1 + 1.2 / 320, 0.9)),
        (RECTANGLE, (0.0, 0.4, 1.0, 0.4 + 1.2 / 240)),
        (RECTANGLE, (0.5, 0.5, 0.5 + 1e-7, 0.5 + 1e-7)),
        (RECTANGLE, (math.nan, 0.0, 1.0, 1.0)),
        (RECTANGLE, (0.0, 0.0, math.inf, 1.0)),
        (POINT, (0.5, 0.5, 0.5 / 320)),
        (POINT, (1.0, 1.0, 1 / 320)),
        (POINT, (0.0, 0.0, 1e-9)),
    ]
    with session, MavlinkCamera(session, station.address):
        station.status()
        for command, params in thin:
            assert station.ask(command, *params) in (DENIED, ACCEPTED, FAILED)
        assert station.ask(RECTANGLE, *good) == ACCEPTED
        assert session.health.state == "running"
        assert len(session.newest.targets) == 1


def test_an_error_in_the_status_is_reported_and_the_next_one_is_sent(
    tmp_path, station, monkeypatch
):
    write_clip(tmp_path / "clip.mp4", 60)
    feed = open_feed(str(tmp_path / "clip.mp4"), notify=lambda note: None)
    session = Session(feed, ssiam.load_tracker("kcf"), "kcf", Recordings())
    notes = []
    session.listen_notes(notes.append)
    with session, MavlinkCamera(session, station.address) as camera:
        original = camera._service.status_after
        monkeypatch.setattr(camera._service, "status_after", lambda step: 1 / 0)
        station.receive()
        while not notes:
            station.receive(0.2)
        monkeypatch.setattr(camera._service, "status_after", original)
        assert station.status() is not None
    assert "the MAVLink tracking status: ZeroDivisionError" in notes[0].message
