"""`open_feed`: opens the feed for a source given on the command line."""

from __future__ import annotations

import io
import os
import re
import select
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, TypeAlias, get_args
from urllib.parse import unquote, urlsplit

from ssiam.addresses import is_address
from ssiam.errors import check_choice
from ssiam.video import Source, open_source
from ssiam.video.containers import Input, Pipe, open_container
from ssiam.video.levels import Levels
from ssiam.video.sources import STDIN, camera_index, open_address
from ssiam.web.feeds.base import Feed
from ssiam.web.feeds.paced import PacedFeed
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.feeds.reconnecting import ReconnectingFeed
from ssiam.web.types import Note

if TYPE_CHECKING:
    from typing_extensions import Buffer

BROWSER: Final = "browser"

Pace: TypeAlias = Literal["clock", "fast"]

# Schemes of servers that send in real time, even if the stream states its length.
_STREAMING: Final = ("rtsp", "rtsps", "rtmp", "rtmps")
# Suffixes of playlists, whose frames arrive in segments of many seconds.
_PLAYLISTS: Final = (".m3u8", ".mpd")
# Seconds of silence after which a stream counts as lost. It takes twice as long for codecs such as
# H.264, because FFmpeg delays the last frame until it is known to be complete.
_SILENCE: Final = 2.0
_STOP_INTERVAL: Final = 0.2  # seconds between two checks for `stop` while standard input is silent


def open_feed(
    spec: str,
    *,
    pace: Pace = "clock",
    notify: Callable[[Note], None],
    stream: int | None = None,
    levels: tuple[float, float] | None = None,
    paused: bool = False,
) -> Feed:
    """Open a source as a feed.

    Parameters
    ----------
    spec : str
        As in `open_source`, or ``"browser"`` for a `PushedFeed`.
    pace : {"clock", "fast"}
        clock: files play in real time, and frames that are not taken in time are dropped.
        fast: each frame waits until it is taken. Cameras and streams always play in real time.
    notify : callable
        Receives notes about the source, on a thread of the feed.
    stream, levels
        As in `open_source`.
    paused : bool
        Whether a file or a folder begins paused, on its first frame. What comes in real time, also
        through a named pipe, does not wait.

    Raises
    ------
    ArgumentError
        The pace is unknown.
    SourceError
        The source cannot be opened.
    """
    check_choice("pace", pace, get_args(Pace))
    if spec == BROWSER:
        return PushedFeed(BROWSER)
    if spec == STDIN and _is_piped():
        source, stop = _open_pipe(stream, levels)
        return PacedFeed(source, notify, every_frame=pace == "fast", stop=stop)
    reopen = partial(_open, spec, stream, levels)
    source = reopen()
    if _is_live(spec, source):
        return ReconnectingFeed(source, notify, reopen, in_bursts=_is_playlist(spec))
    return PacedFeed(
        source,
        notify,
        reopen=None if spec == STDIN else reopen,
        every_frame=pace == "fast",
        paused=paused and _is_stored(spec),
    )


def _open(spec: str, stream: int | None, levels: tuple[float, float] | None) -> Source:
    if not _is_remote(spec) or _is_playlist(spec):
        return open_source(spec, stream=stream, levels=levels)
    chosen = None if levels is None else Levels(*levels)
    return open_address(spec, read_timeout=_SILENCE, stream=stream, levels=chosen)


def _is_live(spec: str, source: Source) -> bool:
    """Whether the source continues while it is not read."""
    if not _is_remote(spec):
        return camera_index(spec) is not None
    return source.length is None or _scheme(spec) in _STREAMING


def _is_stored(spec: str) -> bool:
    path = Path(unquote(urlsplit(spec).path) if is_address(spec) else spec)
    return not _is_remote(spec) and (path.is_file() or path.is_dir())


def _is_remote(spec: str) -> bool:
    return is_address(spec) and _scheme(spec) != "file"


def _is_playlist(spec: str) -> bool:
    return is_address(spec) and re.split(r"[?#]", spec)[0].lower().endswith(_PLAYLISTS)


def _scheme(address: str) -> str:
    return address.partition("://")[0].lower()


class _StoppableInput(io.RawIOBase):
    """Raw bytes of a pipe, which end after `stop`.

    `sys.stdin` cannot be used: a thread that blocks in it aborts the interpreter at exit.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._stopped = threading.Event()

    def stop(self) -> None:
        self._stopped.set()

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Buffer) -> int:
        view = memoryview(buffer)
        while not self._stopped.is_set():
            # On Windows, select works for sockets only.
            if os.name == "nt" or select.select([self._descriptor], [], [], _STOP_INTERVAL)[0]:
                data = os.read(self._descriptor, len(view))
                view[: len(data)] = data
                return len(data)
        return 0


def _is_piped() -> bool:
    """Whether standard input is a pipe, and neither a file nor a terminal."""
    return sys.stdin is not None and not sys.stdin.isatty() and not sys.stdin.buffer.seekable()


def _open_pipe(
    stream: int | None, levels: tuple[float, float] | None
) -> tuple[Source, Callable[[], None]]:
    """A source on standard input, and a function that ends it from any thread."""
    raw = _StoppableInput(sys.stdin.fileno())
    pipe_input = Input(
        name="standard input",
        file=Pipe(io.BufferedReader(raw)),
        advice="pipe in y4m, mpegts or matroska",
        stream=stream,
        levels=None if levels is None else Levels(*levels),
    )
    return open_container(pipe_input), raw.stop
