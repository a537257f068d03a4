"""WebSocket clients of a served session."""

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
    """A WebSocket client of the session."""

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
        """Drop the connection without a close frame."""
        self.socket.socket.close()

    def close_code(self):
        """The code with which the server closes; messages before it are discarded."""
        try:
            while True:
                self.socket.recv(timeout=SECONDS)
        except ConnectionClosed as closed:
            return closed.rcvd.code

    def send(self, **message):
        self.socket.send(json.dumps(message))

    def next(self, kind, seconds=SECONDS):
        """The next message of this type; a step as header and {view: image}."""
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
    """A well-behaved client that acknowledges and counts all steps."""

    def __init__(self, live):
        self._live = live
        self.numbers = []
        self._client = Client(live)
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _watch(self):
        # If the connection is lost the thread ends, which `wait` notices.
        with suppress(ConnectionClosed):
            while True:
                message = self._client.socket.recv()
                if isinstance(message, bytes):
                    number = read_header(message)[0]["number"]
                    self._client.send(type="shown", number=number)
                    self.numbers.append(number)

    def wait(self, count):
        """Wait for `count` more steps."""
        wanted = len(self.numbers) + count
        until(lambda: len(self.numbers) >= wanted or not self._thread.is_alive())
        assert self._thread.is_alive(), "the connection was lost"

    @contextmanager
    def undisturbed(self):
        """Check that steps keep arriving here during the block."""
        self.wait(1)
        made, received = self._live.session.newest.number, len(self.numbers)
        delivered = self._live.feed.delivered
        yield
        self.wait(4)
        made = self._live.session.newest.number - made
        received = len(self.numbers) - received
        delivered = self._live.feed.delivered - delivered
        # The attacker runs in this process too, and takes some of its time.
        assert made >= delivered / 2 - 3
        assert received >= made / 3 - 3

    def close(self):
        self._client.close()
        self._thread.join(SECONDS)


def read_header(message):
    """Header of a binary message, and the offset of its end."""
    (length,) = struct.unpack_from(">I", message)
    return json.loads(message[4 : 4 + length]), 4 + length


def read_step(message):
    """Header and {view: image} of a binary message."""
    (header, at), images = read_header(message), {}
    for entry in header["pictures"]:
        jpeg = message[at : at + entry["bytes"]]
        images[entry["view"]] = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        at += entry["bytes"]
    assert at == len(message)
    return header, images


def step_until(client, condition):
    """The header of the first step that meets the condition."""
    while True:
        header, _ = client.next("step")
        if condition(header):
            return header
