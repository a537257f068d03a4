"""Clients that do not send or do not read are disconnected."""

import json
import time
from contextlib import ExitStack, closing

import pytest
from websockets.exceptions import InvalidStatus

from helpers.live_clients import Client, Watcher
from helpers.live_server import SECONDS, SHORT_LIMITS, read_all, serving, until
from helpers.raw_sockets import frame, opened, raw_socket, send_until_closed
from ssiam.web.server.limits import ServerLimits


def test_idle_connections_are_closed(live):
    with ExitStack() as stack:
        idle = [stack.enter_context(closing(raw_socket(live))) for _ in range(200)]
        # Other clients can still connect.
        assert live.get("/")[0] == 200
        with Client(live) as client:
            client.next("step")
            assert live.connections <= SHORT_LIMITS.connections + 1
        assert [read_all(raw) for raw in idle] == [b""] * 200


def test_idle_clients_are_refused_or_disconnected(live):
    with ExitStack() as stack:
        idle, refused = [], 0
        for _ in range(200):
            try:
                client = Client(live, acknowledge=False)
            except InvalidStatus as error:
                refused += error.response.status_code == 403
                continue
            idle.append(stack.enter_context(client))
        assert len(idle) + refused == 200
        assert refused > 0
        assert live.get("/")[0] == 200
        assert {client.close_code() for client in idle} == {1013}


def test_a_client_that_acknowledges_nothing_is_disconnected(live):
    with Client(live, acknowledge=False) as client:
        began = time.monotonic()
        assert client.close_code() == 1013
        assert time.monotonic() - began > 0.9 * SHORT_LIMITS.stall_seconds


def test_a_client_that_acknowledges_but_never_reads_is_disconnected():
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


def test_a_client_that_pings_and_does_not_read_is_disconnected(live):
    # Only the unread answers exceed a limit.
    limits = ServerLimits(unread_bytes=2**20, frames_per_second=10**9, stall_seconds=999)
    with serving(limits=limits) as other:
        with closing(opened(other, buffer=4096)) as raw:
            send_until_closed(raw, frame(9, bytes(125)) * 100)
        until(lambda: other.clients == 0)


MANY = [
    ("pings", frame(9, bytes(125)) * 500),
    ("pongs", frame(10, bytes(125)) * 500),
    ("empty continuations", frame(1, b"", first=0) + frame(0, b"", first=0) * 500),
]


@pytest.mark.parametrize("data", [m[1] for m in MANY], ids=[m[0] for m in MANY])
def test_a_client_that_floods_control_frames_is_disconnected(live, data):
    with closing(opened(live)) as raw:
        send_until_closed(raw, data)


def test_a_client_that_requests_and_does_not_read_is_disconnected(live):
    request = f"GET /page/index.html HTTP/1.1\r\nHost: 127.0.0.1:{live.port}\r\n\r\n".encode()
    before = live.connections
    with closing(raw_socket(live, buffer=4096)) as raw:
        send_until_closed(raw, request * 100)
    until(lambda: live.connections <= before)


SLOW = [
    ("headers", "GET / HTTP/1.1\r\nX-Slow: ", 0),
    ("second request", "GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\nGET / HTTP/1.1\r\nX: ", 0),
    ("body", "GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Length: 99999\r\n\r\n", 0),
]


@pytest.mark.parametrize("head", [s[1] for s in SLOW], ids=[s[0] for s in SLOW])
def test_requests_that_arrive_byte_by_byte_are_closed(live, head):
    with ExitStack() as stack:
        slow = [stack.enter_context(closing(raw_socket(live))) for _ in range(30)]
        for raw in slow:
            raw.sendall(head.format(live.port).encode())
        began = time.monotonic()
        while slow:
            assert time.monotonic() - began < SECONDS
            slow = [raw for raw in slow if is_open(raw)]
            time.sleep(0.05)
        assert time.monotonic() - began > 0.9 * SHORT_LIMITS.handshake_seconds
        assert live.get("/")[0] == 200


def is_open(raw):
    """Whether the server still accepts a byte."""
    try:
        raw.sendall(b"x")
    except (BrokenPipeError, ConnectionResetError):
        return False
    return True
