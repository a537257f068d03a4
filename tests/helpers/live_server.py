"""A real session on endless pictures, served on a free port of the loopback."""

from __future__ import annotations

import json
import socket
import threading
import time
from contextlib import closing, contextmanager
from dataclasses import dataclass

import numpy as np

import ssiam
from helpers.synthetic import poses, seen, world
from ssiam.video import Frame
from ssiam.web.feeds.newest import Newest
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.recording import Recordings
from ssiam.web.rota import Rota
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.serving import LiveServer
from ssiam.web.session import Session

SIZE = (160, 120)
RATE = 20  # pictures a second
SECONDS = 20  # after which a test gives up
# Patience of the servers of tests, so that the tests need little.
HASTY = ServerLimits(stall_seconds=1.0, handshake_seconds=1.0)


class EndlessFeed(Newest):
    """A camera that shakes for ever."""

    def __init__(self, size):
        super().__init__("endless", size, RATE)
        self.resize(size)
        self.brought = 0
        self._thread = threading.Thread(target=self._bring, daemon=True)
        self._thread.start()

    def resize(self, size):
        """Have frames of another size from now on."""
        background = world(1, size)
        shifts = [(3 * np.sin(k), 2 * np.cos(k), 0.0) for k in range(6)]
        self._pictures = [seen(background, pose) for pose in poses(shifts, size)]

    def _bring(self):
        while not self._closed:
            index = self.brought
            picture = self._pictures[index % len(self._pictures)]
            self._put(Frame(index, index / RATE, picture))
            self.brought += 1
            time.sleep(1 / RATE)


@dataclass
class Live:
    """A session that is being served."""

    session: Session
    news: Rota
    feed: Newest
    server: LiveServer

    @property
    def port(self):
        return self.server.access.port

    @property
    def url(self):
        token = self.server.access.token
        query = "" if token is None else f"?token={token}"
        return f"ws://127.0.0.1:{self.port}/session{query}"

    def http(self, request):
        """The whole answer, byte by byte, to a whole request."""
        with closing(socket.create_connection(("127.0.0.1", self.port), SECONDS)) as raw:
            raw.sendall(request)
            return read_all(raw)

    @property
    def connections(self):
        """How many connections of all kinds the server holds."""
        return len(self.server._server.server_state.connections)

    @property
    def clients(self):
        """How many clients the server says that it has."""
        query = self.url.partition("?")[2]
        return json.loads(self.get(f"/health?{query}")[2])["clients"]

    def get(self, target, *headers, method="GET", host=None):
        """Status, headers and body of an answer to a request that is made of these words."""
        lines = [f"{method} {target} HTTP/1.1", f"Host: {host or f'127.0.0.1:{self.port}'}"]
        request = "\r\n".join([*lines, *headers, "Connection: close", "", ""])
        head, _, body = self.http(request.encode("latin-1")).partition(b"\r\n\r\n")
        status, *fields = head.decode("latin-1").split("\r\n")
        return int(status.split()[1]), dict(f.lower().split(": ", 1) for f in fields), body


@contextmanager
def serving(*, webcam=False, size=SIZE, recordings=None, tracker="csrt", **options):
    """A served session; `options` are those of `LiveServer`."""
    feed, news = PushedFeed() if webcam else EndlessFeed(size), Rota()
    tracker = ssiam.load_tracker(tracker, stabilize="predict")
    options = {"port": 0, "limits": HASTY, **options}
    with (
        Session(feed, tracker, "csrt", Recordings(recordings), news=news) as session,
        LiveServer(session, **options) as server,
    ):
        yield Live(session, news, feed, server)


def until(happened):
    """Wait for it."""
    give_up = time.monotonic() + SECONDS
    while not happened():
        assert time.monotonic() < give_up, "it has not happened"
        time.sleep(0.02)


def read_all(raw):
    """Everything until the other side closes, or resets."""
    parts = []
    try:
        while part := raw.recv(65536):
            parts.append(part)
    except ConnectionResetError:
        pass
    return b"".join(parts)
