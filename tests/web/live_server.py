"""A real session on endless pictures, served on a free port of the loopback; and its clients."""

from __future__ import annotations

import json
import socket
import struct
import threading
import time
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass

import cv2
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import ssiam
from ssiam.video import Frame
from ssiam.web.feeds.newest import Newest
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.recording import Recordings
from ssiam.web.rota import Rota
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.serving import LiveServer
from ssiam.web.session import Session
from synthetic import poses, seen, world

SIZE = (160, 120)
RATE = 20  # pictures a second
SECONDS = 20  # after which a test gives up
# Patience of the servers of tests, so that the tests need little.
HASTY = ServerLimits(stall_seconds=1.0, handshake_seconds=1.0)


class EndlessFeed(Newest):
    """A camera that shakes for ever."""

    def __init__(self, size):
        super().__init__("endless", size, RATE)
        background = world(1, size)
        shifts = [(3 * np.sin(k), 2 * np.cos(k), 0.0) for k in range(6)]
        self._pictures = [seen(background, pose) for pose in poses(shifts, size)]
        self.brought = 0
        self._thread = threading.Thread(target=self._bring, daemon=True)
        self._thread.start()

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
def serving(*, webcam=False, size=SIZE, recordings=None, **options):
    """A served session; `options` are those of `LiveServer`."""
    feed, news = PushedFeed() if webcam else EndlessFeed(size), Rota()
    tracker = ssiam.load_tracker("csrt", stabilize="predict")
    options = {"port": 0, "limits": HASTY, **options}
    with (
        Session(feed, tracker, "csrt", Recordings(recordings), news=news) as session,
        LiveServer(session, **options) as server,
    ):
        yield Live(session, news, feed, server)


class Client:
    """A socket to the session, with what came until now sorted."""

    def __init__(self, live, *, acknowledge=True, **options):
        self._acknowledge = acknowledge
        options = {"max_size": None, "compression": None, "close_timeout": 1, **options}
        self._stack = ExitStack()
        self.socket = self._stack.enter_context(connect(live.url, **options))

    def __enter__(self):
        return self

    def __exit__(self, *exc):
        self.close()

    def close(self):
        self._stack.close()

    def vanish(self):
        """Leave without a word."""
        self.socket.socket.close()

    def close_code(self):
        """The code that the server closes with, whatever it sends before."""
        try:
            while True:
                self.socket.recv(timeout=SECONDS)
        except ConnectionClosed as closed:
            return closed.rcvd.code

    def send(self, **message):
        self.socket.send(json.dumps(message))

    def next(self, kind, seconds=SECONDS):
        """The next message of this type; a step as header and {view: picture}."""
        while True:
            message = self.socket.recv(timeout=seconds)
            found = read_step(message) if isinstance(message, bytes) else json.loads(message)
            header = found[0] if isinstance(found, tuple) else found
            if header["type"] == "step" and self._acknowledge:
                self.send(type="shown", number=header["number"])
            if header["type"] == kind:
                return found

    def ask(self, **command):
        """The answer to a command: `done` or `error`."""
        self.send(**command, ask=7)
        while True:
            message = self.socket.recv(timeout=SECONDS)
            answer = json.loads(message) if isinstance(message, str) else {}
            if answer.get("ask") == 7:
                return answer
            if isinstance(message, bytes) and self._acknowledge:
                self.send(type="shown", number=read_header(message)[0]["number"])


class Watcher:
    """A good client: acknowledges every step, and counts them."""

    def __init__(self, live):
        self._live = live
        self.numbers = []
        self._client = Client(live)
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _watch(self):
        # A connection that is lost ends it, which `wait` notices.
        with suppress(ConnectionClosed):
            while True:
                message = self._client.socket.recv()
                if isinstance(message, bytes):
                    number = read_header(message)[0]["number"]
                    self._client.send(type="shown", number=number)
                    self.numbers.append(number)

    def wait(self, count):
        """Wait for so many steps more."""
        wanted = len(self.numbers) + count
        until(lambda: len(self.numbers) >= wanted or not self._thread.is_alive())
        assert self._thread.is_alive(), "the connection was lost"

    @contextmanager
    def undisturbed(self):
        """Whatever happens meanwhile, the session goes on, and its steps arrive here."""
        self.wait(1)
        made, got = self._live.session.newest.number, len(self.numbers)
        brought = self._live.feed.brought
        yield
        self.wait(4)
        made = self._live.session.newest.number - made
        got = len(self.numbers) - got
        brought = self._live.feed.brought - brought
        # Who attacks runs in this process too, and takes its share of it.
        assert made >= brought / 2 - 3
        assert got >= made / 3 - 3

    def close(self):
        self._client.close()
        self._thread.join(SECONDS)


def read_header(message):
    """Header of a binary message, and where it ends."""
    (length,) = struct.unpack_from(">I", message)
    return json.loads(message[4 : 4 + length]), 4 + length


def read_step(message):
    """Header and {view: picture} of a binary message."""
    (header, at), pictures = read_header(message), {}
    for entry in header["pictures"]:
        jpeg = message[at : at + entry["bytes"]]
        pictures[entry["view"]] = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        at += entry["bytes"]
    assert at == len(message)
    return header, pictures


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
