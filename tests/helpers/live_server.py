"""A real session on an endless feed, served on a free port of the loopback."""

from __future__ import annotations

import json
import socket
import threading
import time
from contextlib import closing, contextmanager
from dataclasses import dataclass

import numpy as np

import ssiam
from helpers.synthetic import camera_frame, poses, world
from ssiam.video import Frame
from ssiam.web.events import Listeners
from ssiam.web.feeds.base import Feed
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.recording import Recordings
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.serving import LiveServer
from ssiam.web.session import Session

SIZE = (160, 120)
RATE = 20  # frames per second
SECONDS = 20  # timeout of a test
# Short time limits, so that tests are fast.
SHORT_LIMITS = ServerLimits(stall_seconds=1.0, handshake_seconds=1.0)


class EndlessFeed(Feed):
    """A shaking camera without end."""

    def __init__(self, size):
        super().__init__("endless", size, RATE)
        self.resize(size)
        self.delivered = 0
        self._thread = threading.Thread(target=self._deliver, daemon=True)
        self._thread.start()

    def resize(self, size):
        """Deliver frames of another size from now on."""
        background = world(1, size)
        shifts = [(3 * np.sin(k), 2 * np.cos(k), 0.0) for k in range(6)]
        self._images = [camera_frame(background, pose) for pose in poses(shifts, size)]

    def _deliver(self):
        while not self._closed:
            index = self.delivered
            image = self._images[index % len(self._images)]
            self._put(Frame(index, index / RATE, image))
            self.delivered += 1
            time.sleep(1 / RATE)


def socket_url(address):
    """The URL of a page's WebSocket, from the address that its server prints."""
    page, _, token = address.partition("#")
    return f"{page.replace('http', 'ws', 1)}session?{token}"


@dataclass
class Live:
    """A served session."""

    session: Session
    notes: Listeners
    feed: Feed
    server: LiveServer

    @property
    def port(self):
        return self.server.access.port

    @property
    def url(self):
        return socket_url(self.server.address)

    def with_token(self, path):
        """A path with the token in its query."""
        return f"{path}?token={self.server.access.token}"

    def http(self, request):
        """The raw response to a raw request."""
        with closing(socket.create_connection(("127.0.0.1", self.port), SECONDS)) as raw:
            raw.sendall(request)
            return read_all(raw)

    @property
    def connections(self):
        """Number of open connections of all kinds."""
        return len(self.server._server.server_state.connections)

    @property
    def clients(self):
        """Number of clients that the server reports."""
        return json.loads(self.get(self.with_token("/health"))[2])["clients"]

    def get(self, target, *headers, method="GET", host=None):
        """Status, headers and body of the response to a request."""
        lines = [f"{method} {target} HTTP/1.1", f"Host: {host or f'127.0.0.1:{self.port}'}"]
        request = "\r\n".join([*lines, *headers, "Connection: close", "", ""])
        head, _, body = self.http(request.encode("latin-1")).partition(b"\r\n\r\n")
        status, *fields = head.decode("latin-1").split("\r\n")
        return int(status.split()[1]), dict(f.lower().split(": ", 1) for f in fields), body


@contextmanager
def serving(*, webcam=False, size=SIZE, recordings=None, tracker="csrt", **options):
    """A served session; `options` are those of `LiveServer`."""
    feed, notes = PushedFeed() if webcam else EndlessFeed(size), Listeners()
    tracker = ssiam.load_tracker(tracker, stabilize="predict")
    options = {"port": 0, "limits": SHORT_LIMITS, **options}
    with (
        Session(feed, tracker, "csrt", Recordings(recordings), notes=notes) as session,
        LiveServer(session, **options) as server,
    ):
        yield Live(session, notes, feed, server)


def until(condition):
    """Wait until the condition is met."""
    deadline = time.monotonic() + SECONDS
    while not condition():
        assert time.monotonic() < deadline, "timed out"
        time.sleep(0.02)


def read_all(raw):
    """All bytes until the server closes or resets the connection."""
    parts = []
    try:
        while part := raw.recv(65536):
            parts.append(part)
    except ConnectionResetError:
        pass
    return b"".join(parts)
