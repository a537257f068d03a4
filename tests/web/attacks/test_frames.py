"""Clients that send invalid WebSocket frames or messages are disconnected."""

import json
from contextlib import closing

import pytest

from helpers.live_clients import Client, Watcher
from helpers.live_server import serving, until
from helpers.message_fuzz import fuzzed
from helpers.raw_sockets import frame, opened, read_code
from helpers.synthetic import generator
from ssiam.web import Hold, Remove, Rename
from ssiam.web.server.incoming import Acknowledge, BadMessage, View, parse_message
from ssiam.web.server.limits import ServerLimits

UNLIMITED = ServerLimits(bad_messages=10**6, messages_per_second=10**6, burst=10**6)
FRAMES = [
    # name, data, close code
    ("large text", frame(1, b'"' + b"x" * 65_536), 1009),
    ("claims to be huge", frame(1, b"", length=2**62), 1009),
    ("large in parts", frame(1, b"x" * 40_000, first=0) + frame(0, b"x" * 40_000), 1009),
    ("binary", frame(2, b"\xff\xd8"), 1008),
    ("large binary", frame(2, bytes(70_000)), 1009),
    ("not UTF-8", frame(1, b"\xff\xfe"), 1007),
    ("no mask", frame(1, b"{}", masked=False), 1002),
    ("compressed", frame(1, b"{}", first=0xC0), 1002),
    ("unknown opcode", frame(3, b"{}"), 1002),
    ("long ping", frame(9, bytes(126)), 1002),
    ("continuation without a start", frame(0, b"{}"), 1002),
    ("too many bad messages", frame(1, b"{") * 20, 1008),
    ("too many messages", frame(1, b'{"type":"shown","number":1}') * 600, 1008),
    ("bad close", frame(8, b"\x00"), 1002),
]


@pytest.mark.parametrize(("sent", "code"), [f[1:] for f in FRAMES], ids=[f[0] for f in FRAMES])
def test_a_client_that_sends_invalid_data_is_disconnected(live, sent, code):
    with closing(opened(live)) as raw:
        raw.sendall(sent)
        assert read_code(raw) == code


def test_a_text_of_the_maximum_size_is_read(live):
    with Client(live) as client:
        client.socket.send(json.dumps({"type": "view", "ask": 7, "x": ""}).ljust(65_536))
        assert client.next("error")["code"] == "bad-message"
        client.socket.send(json.dumps({"type": "hold"}).rjust(65_537))
        assert client.close_code() == 1009


def is_harmless(text):
    """Whether the session keeps running: the well-behaved client expects steps."""
    try:
        content = parse_message(text).content
    except BadMessage:
        return True
    return isinstance(content, (Acknowledge, View, Remove, Rename, Hold))


def test_thousands_of_bad_messages_have_no_effect():
    texts = [text for text in fuzzed(seed=21, count=3000) if is_harmless(text)]
    assert len(texts) > 2000
    with serving(limits=UNLIMITED) as live:
        watcher = Watcher(live)
        with watcher.undisturbed(), Client(live) as client:
            for number, text in enumerate(texts):
                client.socket.send(text)
                if number % 50 == 0:  # a client that does not read is disconnected
                    client.ask(type="view")
            assert client.ask(type="steady", method="off")["type"] == "done"
            assert client.next("step")[0]["stabilize"] == "off"
        watcher.close()


def test_random_frames_on_many_sockets_have_no_effect(live):
    r = generator(22)
    for _ in range(60):
        with closing(opened(live)) as raw:
            for _ in range(20):
                opcode, payload = int(r.integers(16)), r.bytes(int(r.integers(200)))
                first = int(r.choice([0x80, 0x80, 0, 0xF0]))
                try:
                    raw.sendall(frame(opcode, payload, first=first))
                except (BrokenPipeError, ConnectionResetError):
                    break
        until(lambda: live.clients < 4)
