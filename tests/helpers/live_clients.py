"""Clients of a session that is being served."""

from __future__ import annotations

import json
import struct
import threading
from contextlib import ExitStack, contextmanager, suppress

import cv2
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from helpers.live_server import SECONDS, until


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


def step_until(client, wanted):
    """The header of the first step that is as wanted."""
    while True:
        header, _ = client.next("step")
        if wanted(header):
            return header
