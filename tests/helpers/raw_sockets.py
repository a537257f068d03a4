"""Connections that say whatever they like to the server, byte by byte."""

import socket
import struct
import time

from helpers.live_server import SECONDS


def raw_socket(live, *, buffer=None):
    """A connection that has said nothing yet."""
    raw = socket.socket()
    if buffer is not None:
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    raw.settimeout(SECONDS)
    raw.connect(("127.0.0.1", live.port))
    return raw


UPGRADE = (
    *("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13"),
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
)


def handshake(live, *headers, target=None):
    """The request that opens a socket."""
    target = target or "/session?" + live.url.partition("?")[2]
    lines = [f"GET {target} HTTP/1.1", f"Host: 127.0.0.1:{live.port}", *UPGRADE, *headers]
    return "\r\n".join([*lines, "", ""]).encode("latin-1")


def opened(live, **options):
    """A raw connection that has become a socket."""
    raw = raw_socket(live, **options)
    raw.sendall(handshake(live))
    assert raw.recv(12) == b"HTTP/1.1 101"
    return raw


def frame(opcode, payload, *, first=0x80, masked=True, length=None):
    """One frame of a WebSocket, its mask 0."""
    length = len(payload) if length is None else length
    mask = 0x80 if masked else 0
    size = (
        bytes([mask | length]) if length < 126 else struct.pack(">BH", mask | 126, length % 65536)
    )
    if length > 65535:
        size = struct.pack(">BQ", mask | 127, length)
    return bytes([first | opcode]) + size + (bytes(4) if masked else b"") + payload


def read_code(raw):
    """The code that the server closes with."""
    with raw.makefile("rb") as stream:
        while stream.readline() != b"\r\n":
            pass
        while True:
            first, length = stream.read(2)
            if length > 125:
                (length,) = struct.unpack(
                    *((">H", stream.read(2)) if length == 126 else (">Q", stream.read(8)))
                )
            payload = stream.read(length)
            if first == 0x88:
                return int.from_bytes(payload[:2], "big")


def send_until_cut_off(raw, data):
    """Send the same again and again, until nobody takes it."""
    give_up = time.monotonic() + SECONDS
    while time.monotonic() < give_up:
        try:
            raw.sendall(data)
        except (BrokenPipeError, ConnectionResetError):
            return
    raise AssertionError("the server goes on taking it")


def status_of(answer):
    return int(answer.split(b" ", 2)[1])
