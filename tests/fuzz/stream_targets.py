"""What arrives as a stream of bytes: downloads, video through a pipe, MAVLink over UDP and TCP."""

from __future__ import annotations

import io
import os
import socket
import sys
import threading
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from fuzz.target import Target
from helpers.ground_station import HERE, free_port
from helpers.scripted_session import ScriptedSession
from ssiam.runtime import download as downloads
from ssiam.runtime.download import download
from ssiam.runtime.model_zoo import PublishedFile
from ssiam.video import RawFormat, open_source
from ssiam.web.feeds.opening import open_feed
from ssiam.web.mavlink.camera_service import CameraService
from ssiam.web.mavlink.commands import CommandReader
from ssiam.web.mavlink.links import open_link

_CONTENT = bytes(range(256))
_FRAMES = 4  # that are read of a pipe
_SECONDS = 5.0  # until a server or client must have ended
_SILENT_READS = 3  # of a link, after which an input has been read


def stream_targets(folder: Path) -> Iterable[Target]:
    """Servers of downloads, pipes into `ssiam track -` and `ssiam live -`, and ground stations."""
    folder.mkdir(parents=True)
    yield _download_target(folder)
    yield from _pipe_targets()
    yield from _mavlink_targets()


def _download_target(folder: Path) -> Target:
    """A server, also for all addresses to which it redirects: it is the proxy too."""
    downloads._WAIT = 0.0  # type: ignore[misc]
    downloads._ATTEMPTS = 2  # type: ignore[misc]
    server = socket.create_server((HERE, 0))
    address = f"http://{HERE}:{server.getsockname()[1]}"
    answers = [b""]

    def answer() -> None:
        while True:
            try:
                client, _ = server.accept()
            except OSError:  # closed
                return
            with client, suppress(OSError):
                client.settimeout(_SECONDS)
                request = b""
                while b"\r\n\r\n" not in request and (data := client.recv(1 << 16)):
                    request += data
                client.sendall(answers[0])

    threading.Thread(target=answer, daemon=True).start()
    files = (
        PublishedFile("a.bin", f"{address}/a", len(_CONTENT), "0" * 64),
        PublishedFile("b.bin", f"{address}/b"),
        PublishedFile("c.bin", "https://weights.invalid/c"),
    )

    def read(data: bytes) -> None:
        answers[0] = data
        kept = {name: os.environ.get(name) for name in ("http_proxy", "https_proxy", "no_proxy")}
        os.environ.update(http_proxy=address, https_proxy=address, no_proxy="")
        try:
            download(files[len(data) % len(files)], folder)
        finally:
            for name, value in kept.items():
                os.environ.pop(name)
                if value is not None:
                    os.environ[name] = value

    head = b'HTTP/1.1 200 OK\r\nETag: "one"\r\nContent-Length: 256\r\n\r\n'
    part = b"HTTP/1.1 206 Partial Content\r\nContent-Range: bytes 128-255/256\r\n\r\n"
    moved = b"HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1/b\r\nContent-Length: 0\r\n\r\n"
    chunks = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n80\r\n%b\r\n0\r\n\r\n"
    cut = head + _CONTENT[:128]
    seeds = (head + _CONTENT, cut, part + _CONTENT[128:], moved, chunks % _CONTENT[:128])
    return Target("download", seeds, read, 1, server.close)


def _encoded(format: str, codec: str, pixels: str = "yuv420p") -> bytes:
    file = io.BytesIO()
    with av.open(file, "w", format=format) as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, pixels
        for shade in range(0, 250, 10):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), shade, np.uint8), "bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return file.getvalue()


def _pipe_targets() -> Iterable[Target]:
    raw = RawFormat((64, 48), "bgr24", Fraction(25))

    def tracked(**options: Any) -> None:
        with suppress(StopIteration), open_source("-", **options) as source:
            for _ in range(_FRAMES):
                next(source)

    def live() -> None:
        feed = open_feed("-", pace="fast", notify=lambda note: None)
        feed.close()

    y4m, mpegts = _encoded("yuv4mpegpipe", "wrapped_avframe"), _encoded("mpegts", "mpeg2video")
    yield Target("y4m pipe", (y4m,), _piped(tracked), 2)
    yield Target("mpegts pipe", (mpegts,), _piped(tracked), 1)
    frames = bytes(64 * 48 * 3 * 3)
    yield Target("raw pipe", (frames,), _piped(lambda: tracked(raw=raw)), 2)
    yield Target("live pipe", (y4m,), _piped(live), 1)


def _piped(read: Callable[[], None]) -> Callable[[bytes], None]:
    """Give an input to `read` through a pipe as standard input."""

    def read_bytes(data: bytes) -> None:
        source, sink = os.pipe()

        def write() -> None:
            with suppress(OSError), open(sink, "wb") as file:
                file.write(data)

        writer = threading.Thread(target=write, daemon=True)
        given, sys.stdin = (
            sys.stdin,
            SimpleNamespace(  # type: ignore[assignment]
                buffer=io.BufferedReader(io.FileIO(source)),
                isatty=lambda: False,
                fileno=lambda: source,
            ),
        )
        writer.start()
        try:
            read()
        finally:
            stdin, sys.stdin = sys.stdin, given
            stdin.buffer.close()
            writer.join(_SECONDS)

    return read_bytes


def _mavlink_targets() -> Iterable[Target]:
    """The parts of `MavlinkCamera` on this thread, without its limits of commands a second."""
    stack = ExitStack()
    session = stack.enter_context(ScriptedSession())
    session.step()
    sender = mavlink.MAVLink(None, srcSystem=254, srcComponent=190)
    numbers = (2004, 2005, 2010, 511, 512, 521)  # track point, rectangle, stop; interval, requests
    packets = tuple(
        bytes(
            mavlink.MAVLink_command_long_message(
                1, 100, number, 0, 0.4, 0.5, 0.6, 0.7, 0, 0, 0
            ).pack(sender)
        )
        for number in numbers
    )

    def executed(link: Any, send: Callable[[bytes], object]) -> Callable[[bytes], None]:
        reader, service = CommandReader(1, 100), CameraService(session)  # type: ignore[arg-type]
        answers = mavlink.MAVLink(None, srcSystem=1, srcComponent=100)

        def read(data: bytes) -> None:
            with suppress(OSError):
                send(data)
            silent = 0
            while silent < _SILENT_READS:
                found = link.read(0.001)
                silent = 0 if found else silent + 1
                is_complete = link.datagrams or silent > 1
                for command in reader.commands(found, is_complete=is_complete):
                    for message in service.handle(command):
                        link.write(bytes(message.pack(answers)))
            for message in service.results():
                link.write(bytes(message.pack(answers)))

        return read

    port = free_port()
    udp = open_link(f"udpin:{HERE}:{port}")
    stack.callback(udp.close)
    station = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    station.connect((HERE, port))
    yield Target("MAVLink over UDP", packets, executed(udp, station.send), 2, stack.close)
    listener = stack.enter_context(socket.create_server((HERE, 0)))
    tcp = open_link(f"tcp:{HERE}:{listener.getsockname()[1]}")
    stack.callback(tcp.close)
    tcp.read(0)
    peer = stack.enter_context(listener.accept()[0])
    peer.setblocking(False)

    def send(data: bytes) -> None:
        with suppress(BlockingIOError):
            while peer.recv(1 << 16):
                pass
        peer.send(data)

    yield Target("MAVLink over TCP", packets, executed(tcp, send), 2)
