"""Raw TCP connections to the server, for malformed requests and WebSocket frames."""

import socket
import struct
import time

from helpers.live_server import SECONDS


def raw_socket(live, *, buffer=None):
    """A connection that has sent nothing yet."""
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
    """The request that opens a WebSocket."""
    target = target or "/session?" + live.url.partition("?")[2]
    lines = [f"GET {target} HTTP/1.1", f"Host: 127.0.0.1:{live.port}", *UPGRADE, *headers]
    return "\r\n".join([*lines, "", ""]).encode("latin-1")


def opened(live, **options):
    """A raw connection after the WebSocket handshake."""
    raw = raw_socket(live, **options)
    raw.sendall(handshake(live))
    assert raw.recv(12) == b"HTTP/1.1 101"
    return raw


def frame(opcode, payload, *, first=0x80, masked=True, length=None):
    """A WebSocket frame with the mask 0."""
    length = len(payload) if length is None else length
    mask = 0x80 if masked else 0
    size = (
        bytes([mask | length]) if length < 126 else struct.pack(">BH", mask | 126, length % 65536)
    )
    if length > 65535:
        size = struct.pack(">BQ", mask | 127, length)
    return bytes([first | opcode]) + size + (bytes(4) if masked else b"") + payload


def read_code(raw):
    """The code with which the server closes the WebSocket."""
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


def send_until_closed(raw, data):
    """Send the same data until the server closes the connection."""
    deadline = time.monotonic() + SECONDS
    while time.monotonic() < deadline:
        try:
            raw.sendall(data)
        except (BrokenPipeError, ConnectionResetError):
            return
    raise AssertionError("the server still accepts the data")


def status_of(answer):
    return int(answer.split(b" ", 2)[1])
