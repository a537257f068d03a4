"""A TraX server, through which the official VOT toolkit runs a tracker of this package.

The official toolkit draws a polygon with its borders and a rectangle as w by h pixels, so that an
exact rectangle has an overlap of only .95 with a polygon. A target given as a polygon is therefore
reported as polygons whose right and lower corners are the last pixels (x + w - 1), the inverse of
`area_preserving_xywh`. A target given as a rectangle is reported as rectangles.
"""

from __future__ import annotations

import importlib.util
import os
import re
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread
from types import TracebackType
from typing import Any

import cv2
import numpy as np

from ssiam.datasets.images import image_levels, read_image
from ssiam.errors import ArgumentError, MissingExtraError, StreamError, one_line
from ssiam.geometry import corners_from_xywh
from ssiam.parsing import is_number_word
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker
from ssiam.video.levels import Levels

_STDIN, _STDOUT, _STDERR = 0, 1, 2
_IN_VARIABLE = "TRAX_IN"  # environment variable of libtrax, as _OUT_VARIABLE
_SOCKET_VARIABLE = "TRAX_SOCKET"  # the port of a client that listens
_HOST, _CONNECT_TIMEOUT = "127.0.0.1", 10.0  # seconds
_READ_BYTES = 1 << 16
_MAX_LINE = 1 << 20  # bytes; a polygon of a thousand corners has 20,000
_MESSAGE, _START, _QUIT = b"@@TRAX:", b"@@TRAX:initialize", b"@@TRAX:quit"
# An argument and its closing quote. Without one the argument goes on to the end of the line, and no
# part of the line is read twice.
_ARGUMENT = re.compile(rb'"((?:[^"\\]|\\.?)*)("?)')
_REGION = re.compile(rb"\s*-?[0-9][0-9.eE+-]*(\s*,\s*-?[0-9][0-9.eE+-]*){3,}\s*")
# Environment variable of libtrax: the descriptor to write to in place of standard output.
_OUT_VARIABLE = "TRAX_OUT"


def check_trax() -> None:
    """Raise `MissingExtraError` unless vot-trax is installed."""
    if importlib.util.find_spec("trax") is None:
        raise MissingExtraError("a TraX server needs vot-trax: pip install 'ssiam[vot]'")


def serve(tracker: StabilizedTracker) -> None:
    """Serve a TraX client on standard input and output until it quits.

    Call it inside `reserve_stdout`. The client may start the tracker any number of times, on
    rectangles or polygons; the confidence is `Track.score`.

    Raises
    ------
    MissingExtraError
        vot-trax is not installed.
    SourceError
        An image is missing or damaged. This and every other error is sent to the client as the
        reason of the quit message.
    StreamError
        The client disconnected, or violated the protocol.
    """
    check_trax()
    with _Session() as session:
        start: Any = None
        levels: Levels | None = None
        while (request := session.next()) is not None:
            if start is None and not request.objects:
                raise StreamError("the TraX client sent a frame before it started a target")
            path = Path(request.image["color"].path())
            if request.objects:
                levels = image_levels(path)
            image = read_image(path, levels)
            if request.objects:
                start = request.objects[0][0]
                tracker.init(image, _start_box(start))
                session.reply(start, 1.0)
            else:
                track = tracker.update(image)
                session.reply(_region_from_track(track, start), track.score)


class _Session:
    """The session with one client; an error inside its block is sent to the client."""

    def __init__(self) -> None:
        import trax

        self._relay = _Relay()
        # Not the "vot" metadata: with it the toolkit starts a new process at every start.
        self._server = trax.Server(
            [trax.Region.RECTANGLE, trax.Region.POLYGON], [trax.Image.PATH], tracker_name="ssiam"
        )

    def next(self) -> Any:
        """The next request to start or to track; None when the client quits."""
        from trax import TraxException, TraxStatus

        try:
            request = self._server.wait()
        except TraxException:
            request = None
        if request is None or (request.type == TraxStatus.QUIT and self._relay.broke_off):
            raise StreamError(
                "the TraX client disconnected, or violated the protocol (it starts a target before "
                "it sends frames, and ends with quit)"
            )
        return None if request.type == TraxStatus.QUIT else request

    def reply(self, region: Any, confidence: float) -> None:
        """Send the target's region to the client."""
        self._server.status([(region, {"confidence": confidence})])

    def __enter__(self) -> _Session:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._server.quit(None if exc is None else one_line(exc))
        self._relay.finish()


class _Relay:
    """Gives libtrax the messages of standard input, or of the client's socket, that it can read.

    libtrax waits without end, and without a pause, after a message that breaks off and after a
    client that has disconnected before its first frame; an empty region ends the process.

    Attributes
    ----------
    broke_off : bool
        Whether the messages ended without quit, or with one that libtrax cannot read.
    """

    def __init__(self) -> None:
        self.broke_off = False
        self._source = _given_descriptor()
        self._socket = _connected()
        if self._socket is not None:
            self._source = self._socket.fileno()
            os.environ[_OUT_VARIABLE] = str(self._source)
        whole, self._target = os.pipe()
        os.environ[_IN_VARIABLE] = str(whole)
        Thread(target=self._run, daemon=True).start()

    def finish(self) -> None:
        """Tell a client with a socket that this was the last answer."""
        if self._socket is not None:
            with suppress(OSError):
                self._socket.shutdown(socket.SHUT_WR)

    def _run(self) -> None:
        with suppress(OSError), open(self._target, "wb", buffering=0) as file:
            for line in self._lines():
                if not _is_readable(line):
                    break
                file.write(line + b"\n")
                if line.startswith(_QUIT):
                    return
            self.broke_off = True
            file.write(_QUIT + b" \n")

    def _lines(self) -> Iterator[bytes]:
        """Lines until the end, or until one is too long; not one that breaks off."""
        rest = b""
        while len(rest) <= _MAX_LINE and (data := os.read(self._source, _READ_BYTES)):
            *lines, rest = (rest + data).split(b"\n")
            yield from lines


def _given_descriptor() -> int:
    """The descriptor of the client's messages: standard input, unless TRAX_IN gives another one.

    Raises
    ------
    StreamError
        It is not the number of an open one.
    """
    word = os.environ.get(_IN_VARIABLE, str(_STDIN))
    with suppress(OSError, ValueError, OverflowError):
        os.fstat(int(word))
        return int(word)
    raise StreamError(f"no TraX client: {_IN_VARIABLE}={word[:40]!r} is not an open descriptor")


def _connected() -> socket.socket | None:
    """The connection to a client that listens, in place of libtrax's own; None without one.

    Raises
    ------
    StreamError
        No client listens there.
    """
    port = os.environ.pop(_SOCKET_VARIABLE, None)
    if port is None:
        return None
    try:
        if not is_number_word(port):
            raise ValueError("not a port")
        client = socket.create_connection((_HOST, int(port)), _CONNECT_TIMEOUT)
        client.settimeout(None)  # libtrax and the relay use its descriptor
        # libtrax writes an answer in pieces, each of which would wait for the one before it.
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return client
    except (OSError, ValueError, OverflowError) as error:
        raise StreamError(
            f"no TraX client listens at {_SOCKET_VARIABLE}={port[:40]} ({one_line(error)})"
        ) from error


def _is_readable(line: bytes) -> bool:
    """Whether libtrax can read a line: other output, or a message with whole arguments."""
    if not line.startswith(_MESSAGE):
        return b'"' not in line
    words: list[bytes] = []
    for argument in _ARGUMENT.finditer(line):
        if not argument[1] or not argument[2]:
            return False
        words.append(argument[1])
    # The official client sends a start without a region before one with a polygon.
    is_start = line.startswith(_START) and bool(words)
    return not is_start or _REGION.fullmatch(words[0]) is not None


def _start_box(region: Any) -> list[float]:
    """What a tracker starts on: x, y, w, h of a `trax.Rectangle`, the corners of a `trax.Polygon`.

    Of a polygon with more than four corners, those of its smallest rotated box; pixels.

    Raises
    ------
    ArgumentError
        The region has another type.
    """
    if region.type not in ("rectangle", "polygon"):
        raise ArgumentError(
            f"cannot start on a region of type {region.type!r}: give a rectangle or a polygon"
        )
    if _is_rectangle(region):
        return list(region.bounds())
    points = np.array(list(region), dtype=np.float32)
    if len(points) != 4:
        points = np.asarray(cv2.boxPoints(cv2.minAreaRect(points)))
    return [float(number) for number in points.ravel()]


def _region_from_track(track: Track, start: Any) -> Any:
    """The track as a region of the type of `start`; a rotated box always as a polygon."""
    import trax

    x, y, w, h = track.box
    if track.corners is not None:
        corners = track.corners
    elif _is_rectangle(start):
        return trax.Rectangle.create(x, y, w, h)
    else:
        corners = corners_from_xywh((x, y, w - 1, h - 1))
    return trax.Polygon.create([(float(x), float(y)) for x, y in corners])


def _is_rectangle(region: Any) -> bool:
    return bool(region.type == "rectangle")


@contextmanager
def reserve_stdout() -> Iterator[None]:
    """Reserve standard output for the protocol, in Python and in C, until the process ends.

    Other output is redirected to standard error. The official toolkit reads both through one pipe,
    in which an incomplete line of other output hides the message that follows: if both are the same
    file, other output is discarded, and standard error is restored afterwards.
    """
    sys.stdout.flush()
    os.environ[_OUT_VARIABLE] = str(os.dup(_STDOUT))
    stderr = os.dup(_STDERR)
    if os.path.sameopenfile(_STDOUT, _STDERR):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, _STDERR)
        os.close(null)
    os.dup2(_STDERR, _STDOUT)
    try:
        yield
    finally:
        sys.stderr.flush()
        os.dup2(stderr, _STDERR)
        os.close(stderr)
