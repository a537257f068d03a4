"""Who does not speak, or does not listen, is dropped."""

import json
import time
from contextlib import ExitStack, closing

import pytest
from websockets.exceptions import InvalidStatus

from helpers.live_clients import Client, Watcher
from helpers.live_server import HASTY, SECONDS, read_all, serving, until
from helpers.raw_sockets import frame, opened, raw_socket, send_until_cut_off
from ssiam.web.server.limits import ServerLimits


def test_connections_that_say_nothing_are_dropped(live):
    with ExitStack() as stack:
        silent = [stack.enter_context(closing(raw_socket(live))) for _ in range(200)]
        # Meanwhile everybody else gets in.
        assert live.get("/")[0] == 200
        with Client(live) as client:
            client.next("step")
            assert live.connections <= HASTY.connections + 1
        assert [read_all(raw) for raw in silent] == [b""] * 200


def test_sockets_that_say_nothing_are_refused_or_dropped(live):
    with ExitStack() as stack:
        silent, refused = [], 0
        for _ in range(200):
            try:
                client = Client(live, acknowledge=False)
            except InvalidStatus as error:
                refused += error.response.status_code == 403
                continue
            silent.append(stack.enter_context(client))
        assert len(silent) + refused == 200
        assert refused > 0
        assert live.get("/")[0] == 200
        assert {client.close_code() for client in silent} == {1013}


def test_a_client_that_acknowledges_nothing_is_sent_away(live):
    with Client(live, acknowledge=False) as client:
        began = time.monotonic()
        assert client.close_code() == 1013
        assert time.monotonic() - began > 0.9 * HASTY.stall_seconds


def test_a_client_that_acknowledges_but_never_reads_is_dropped():
    with serving(size=(640, 360)) as live:
        watcher = Watcher(live)
        with watcher.undisturbed(), closing(opened(live, buffer=4096)) as raw:
            view = {"type": "view", "raw": True, "steadied": True, "width": 4096, "quality": 95}
            raw.sendall(frame(1, json.dumps(view).encode()))
            number = 0
            try:
                while live.clients > 1:
                    number = live.session.newest.number
                    shown = json.dumps({"type": "shown", "number": number})
                    raw.sendall(frame(1, shown.encode()))
                    time.sleep(0.02)
            except (BrokenPipeError, ConnectionResetError):
                until(lambda: live.clients == 1)
            assert number > 10
            until(lambda: live.connections == 1)
        watcher.close()


def test_one_that_makes_the_server_speak_and_does_not_listen_is_dropped(live):
    # Few enough a second that only their answers are too many.
    limits = ServerLimits(unread_bytes=2**20, frames_a_second=10**9, stall_seconds=999)
    with serving(limits=limits) as other:
        with closing(opened(other, buffer=4096)) as raw:
            send_until_cut_off(raw, frame(9, bytes(125)) * 100)
        until(lambda: other.clients == 0)


MANY = [
    ("pings", frame(9, bytes(125)) * 500),
    ("pongs", frame(10, bytes(125)) * 500),
    ("parts of nothing", frame(1, b"", first=0) + frame(0, b"", first=0) * 500),
]


@pytest.mark.parametrize("data", [m[1] for m in MANY], ids=[m[0] for m in MANY])
def test_one_that_sends_frames_without_end_is_dropped(live, data):
    with closing(opened(live)) as raw:
        send_until_cut_off(raw, data)


def test_one_that_asks_and_does_not_read_is_dropped(live):
    request = f"GET /page/index.html HTTP/1.1\r\nHost: 127.0.0.1:{live.port}\r\n\r\n".encode()
    before = live.connections
    with closing(raw_socket(live, buffer=4096)) as raw:
        send_until_cut_off(raw, request * 100)
    until(lambda: live.connections <= before)


SLOW = [
    ("headers", "GET / HTTP/1.1\r\nX-Slow: ", 0),
    ("second request", "GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\nGET / HTTP/1.1\r\nX: ", 0),
    ("body", "GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Length: 99999\r\n\r\n", 0),
]


@pytest.mark.parametrize("head", [s[1] for s in SLOW], ids=[s[0] for s in SLOW])
def test_requests_that_come_byte_by_byte_are_dropped(live, head):
    with ExitStack() as stack:
        slow = [stack.enter_context(closing(raw_socket(live))) for _ in range(30)]
        for raw in slow:
            raw.sendall(head.format(live.port).encode())
        began = time.monotonic()
        while slow:
            assert time.monotonic() - began < SECONDS
            slow = [raw for raw in slow if is_heard(raw)]
            time.sleep(0.05)
        assert time.monotonic() - began > 0.9 * HASTY.handshake_seconds
        assert live.get("/")[0] == 200


def is_heard(raw):
    """Whether the other side still takes a byte."""
    try:
        raw.sendall(b"x")
    except (BrokenPipeError, ConnectionResetError):
        return False
    return True
